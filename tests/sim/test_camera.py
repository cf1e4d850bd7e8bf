import numpy as np
import pytest

from anm_gym.geometry import CameraSpec, backproject, camera_pose
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.backends import make_depth_camera

EYE = (0.0, 1.25, 0.0)
SMALL = {"width_px": 64, "height_px": 48}


def quad(corners) -> TriangleMesh:
    return TriangleMesh(np.array(corners, np.float64), np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def room_depth_m(pose, spec, low, high):
    """Planar depth of the inside of an axis-aligned box, in closed form."""
    rays = spec.directions.astype(np.float64) @ pose[:3, :3].T
    with np.errstate(divide="ignore"):
        exits = np.where(rays > 0, (high - pose[:3, 3]) / rays, (low - pose[:3, 3]) / rays)
    return np.where(rays == 0, np.inf, exits).min(axis=-1)


@pytest.mark.parametrize("heading_rad", [0.0, 0.5, 2.2, -1.3])
def test_a_closed_room_is_as_deep_as_its_walls(box_room, make_camera, heading_rad):
    camera = make_camera(box_room(width_m=4.0, depth_m=6.0), **SMALL)
    pose = camera_pose((0.7, 1.25, -0.4), heading_rad)
    expected = room_depth_m(pose, camera.spec, np.array([-2.0, 0.0, -3.0]), np.array([2.0, 2.5, 3.0]))
    depth = camera.render(pose)
    assert depth.shape == (48, 64)
    assert depth.dtype == np.float32
    np.testing.assert_allclose(depth, expected, atol=1e-4)


def test_a_facing_wall_has_the_same_planar_depth_in_every_pixel(make_camera):
    camera = make_camera(quad([(-9, -9, -3), (9, -9, -3), (9, 9, -3), (-9, 9, -3)]), **SMALL)
    np.testing.assert_allclose(camera.render(camera_pose(EYE, 0.0)), 3.0, atol=1e-5)


def test_a_slanted_plane_is_sampled_at_the_centres_of_the_pixels(make_camera):
    camera = make_camera(quad([(-9, -9, -13), (9, -9, 5), (9, 9, 5), (-9, 9, -13)]), **SMALL)
    x = (np.arange(64) + 0.5 - 32.0) / 32.0
    depth = camera.render(camera_pose(EYE, 0.0))
    np.testing.assert_allclose(
        depth, np.broadcast_to(4.0 / (1.0 + x), (48, 64)) * (4.0 / (1.0 + x) <= 10), atol=1e-4
    )


def test_a_ball_shows_its_near_side(sphere, make_camera):
    camera = make_camera(sphere, width_px=65, height_px=65)
    depth = camera.render(camera_pose(EYE, 0.0))
    assert depth[32, 32] == pytest.approx(1.5, abs=2e-3)
    points = backproject(depth, camera.spec, camera_pose(EYE, 0.0))
    np.testing.assert_allclose(np.linalg.norm(points - [0, 1.25, -2], axis=1), 0.5, atol=2e-3)
    seen_share = (depth > 0).mean()
    assert seen_share == pytest.approx(np.pi * (0.5**2 / (2**2 - 0.5**2)) / 4, rel=0.05)


@pytest.mark.parametrize(("heading_rad", "side"), [(0.6, "right"), (-0.6, "left"), (0.0, "middle")])
def test_what_was_ahead_moves_right_when_the_camera_turns_left(sphere, make_camera, heading_rad, side):
    depth = make_camera(sphere, width_px=60, height_px=60).render(camera_pose(EYE, heading_rad))
    column = np.nonzero(depth)[1].mean()
    assert {"left": column < 20, "middle": abs(column - 29.5) < 1, "right": column > 40}[side]


def test_the_first_row_looks_up(sphere, make_camera):
    depth = make_camera(sphere, width_px=60, height_px=60).render(camera_pose((0.0, 0.5, 0.0), 0.0))
    assert np.nonzero(depth)[0].mean() < 20


def test_a_tilted_camera_sees_the_floor(box_room, make_camera):
    pitch = np.eye(4)
    pitch[1:3, 1:3] = [[0.0, 1.0], [-1.0, 0.0]]
    camera = make_camera(box_room(), width_px=8, height_px=8)
    np.testing.assert_allclose(camera.render(camera_pose(EYE, 0.4) @ pitch), 1.25, atol=1e-5)


def test_depth_outside_the_limits_is_empty(box_room, make_camera):
    room = box_room(width_m=4.0, depth_m=8.0)
    near = make_camera(room, **SMALL, max_depth_m=3.0).render(camera_pose(EYE, 0.0))
    far = make_camera(room, **SMALL, min_depth_m=3.0).render(camera_pose(EYE, 0.0))
    everything = make_camera(room, **SMALL).render(camera_pose(EYE, 0.0))
    np.testing.assert_array_equal(near, np.where(everything <= 3.0, everything, 0.0))
    np.testing.assert_array_equal(far, np.where(everything >= 3.0, everything, 0.0))
    assert (near == 0).any()
    assert (far == 0).any()


def test_nothing_in_view_is_empty(sphere, make_camera):
    assert not make_camera(sphere, **SMALL).render(camera_pose(EYE, np.pi)).any()


def test_surfaces_are_seen_from_both_sides(make_camera):
    corners = [(-9, -9, -3), (9, -9, -3), (9, 9, -3), (-9, 9, -3)]
    images = [
        make_camera(quad(order), **SMALL).render(camera_pose(EYE, 0.0)) for order in (corners, corners[::-1])
    ]
    np.testing.assert_allclose(*images, atol=1e-6)


def test_a_batch_of_poses_gives_the_images_of_each(two_rooms, make_camera):
    camera = make_camera(two_rooms, **SMALL)
    poses = np.stack([camera_pose((x, 1.25, 0.3), x) for x in (-2.0, 1.0, 2.5)])
    batch = camera.render(poses)
    assert batch.shape == (3, 48, 64)
    np.testing.assert_array_equal(batch, [camera.render(pose) for pose in poses])
    assert camera.render(poses[:0]).shape == (0, 48, 64)


def test_the_same_pose_gives_the_same_image_and_images_are_not_shared(two_rooms, make_camera):
    camera = make_camera(two_rooms, **SMALL)
    first = camera.render(camera_pose((-2.0, 1.25, 0.0), 0.3))
    kept = first.copy()
    camera.render(camera_pose((2.0, 1.25, 0.0), 0.9))
    np.testing.assert_array_equal(first, kept)
    np.testing.assert_array_equal(camera.render(camera_pose((-2.0, 1.25, 0.0), 0.3)), kept)


def test_a_cast_measures_in_lengths_of_the_direction(make_camera):
    camera = make_camera(quad([(-1, -1, -3), (1, -1, -3), (1, 1, -3), (-1, 1, -3)]))
    directions = np.array([[0, 0, -1], [0, 0, -6], [0, 0, 1], [0.05, -0.05, -1]], np.float32)
    hits = camera.cast(np.zeros((4, 3), np.float32), directions)
    np.testing.assert_allclose(hits.distance, [3.0, 0.5, np.inf, 3.0], atol=1e-5)
    assert hits.triangle[2:].tolist() == [-1, 0]
    assert hits.distance.dtype == np.float32
    assert hits.triangle.dtype == np.int32


def test_the_triangle_of_each_pixel_lies_at_its_depth(two_rooms, make_camera):
    camera = make_camera(two_rooms, **SMALL)
    pose = camera_pose((-2.0, 1.25, 0.3), -1.2)
    triangle = camera.render_triangles(pose)
    assert (triangle >= 0).all()
    points = backproject(camera.render(pose), camera.spec, pose)
    corners, normals = two_rooms.triangles[triangle.ravel(), 0], two_rooms.normals[triangle.ravel()]
    np.testing.assert_allclose(np.einsum("nd,nd->n", points - corners, normals), 0.0, atol=1e-4)


def test_poses_must_be_4_by_4(sphere, make_camera):
    with pytest.raises(
        ValueError, match=r"`world_from_camera` must have shape \(4, 4\) or \(N, 4, 4\), got \(3, 4\)"
    ):
        make_camera(sphere).render(np.eye(4)[:3])


def test_rays_must_be_contiguous_single_precision(sphere, make_camera):
    rays = np.zeros((5, 3), np.float32)
    for origins, directions in [(rays.astype(np.float64), rays), (rays, rays[:4]), (rays, rays[:, ::-1])]:
        with pytest.raises(ValueError, match=r"must be \(5, 3\) float32 in C order"):
            make_camera(sphere).cast(origins, directions)


def test_an_unknown_backend_is_refused_with_the_choices(sphere):
    with pytest.raises(ValueError, match="unknown depth backend 'opengl'; choose one of: embree, warp"):
        make_depth_camera(sphere, CameraSpec(), backend="opengl")
