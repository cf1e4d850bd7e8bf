from dataclasses import replace

import numpy as np
import pytest

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.map.grid_fusion import ego_frame
from anm_gym.map.projection import (
    PRESETS,
    ProjectionSettings,
    class_probabilities,
    count_hits,
    project_depth,
    seen_masks,
)
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.backends import make_depth_camera
from anm_gym.sim.grid import GridFrame

CAMERA = CameraSpec(width_px=64, height_px=64)
ALL_PIXELS = ProjectionSettings(max_depth_m=8.0, obstacle_max_m=2.2)


def wall_at(depth_m: float) -> np.ndarray:
    return np.full((64, 64, 1), depth_m, np.float32)


def test_flat_wall_is_a_line_of_obstacles_at_its_distance() -> None:
    hits = project_depth(wall_at(2.0), CAMERA, ALL_PIXELS)
    walls = hits.points_xz[hits.is_occupied]
    assert walls[:, 1] == pytest.approx(-2.0)
    # Half of 64 columns at 90 degrees: the outermost pixel centre is half a pixel from the edge.
    assert np.abs(walls[:, 0]).max() == pytest.approx(2.0 * 31.5 / 32.0)


def test_height_decides_between_floor_obstacle_and_ceiling() -> None:
    hits = project_depth(wall_at(2.0), CAMERA, ALL_PIXELS)
    heights_m = 1.25 + 2.0 * CAMERA.directions[:, 0, 1]
    num_obstacles = 64 * ((heights_m > 0.25) & (heights_m < 2.2)).sum()
    num_floor = 64 * (heights_m <= 0.25).sum()
    assert hits.is_occupied.sum() == num_obstacles
    assert (~hits.is_occupied).sum() == num_floor


def test_ceiling_is_free_only_by_the_rule_of_ans() -> None:
    floor_only = project_depth(wall_at(2.0), CAMERA, ALL_PIXELS)
    both = project_depth(wall_at(2.0), CAMERA, replace(ALL_PIXELS, free_rule="not_obstacle"))
    assert len(both.points_xz) == 64 * 64 > len(floor_only.points_xz)


@pytest.mark.parametrize(
    ("preset", "near", "far"), [("upen", 0.5, 3.0), ("occant", 0.0, 3.25), ("ans", 0.0, 3.2)]
)
def test_preset_uses_the_published_range(preset: str, near: float, far: float) -> None:
    settings = PRESETS[preset]
    for depth_m, counts in ((near, False), (near + 0.01, True), (far, True), (far + 0.01, False)):
        hits = project_depth(wall_at(depth_m), CAMERA, settings)
        assert (len(hits.points_xz) > 0) is counts


def test_ans_fills_a_hole_with_the_farthest_depth_of_its_column() -> None:
    depth = wall_at(2.0)
    depth[:, 7] = 1.0
    depth[20:40, 7] = 0.0
    filled = project_depth(depth, CAMERA, PRESETS["ans"])
    assert len(filled.points_xz) == 64 * 64
    assert len(project_depth(depth, CAMERA, PRESETS["upen"]).points_xz) < 64 * 64 - 20


def test_world_points_lie_on_the_walls_of_a_room(box_room) -> None:
    renderer = make_depth_camera(box_room(), CAMERA)
    pose = camera_pose((0.3, 1.25, -0.4), 0.7)
    hits = project_depth(renderer.render(pose), CAMERA, ALL_PIXELS, pose)
    farthest = np.abs(hits.points_xz[hits.is_occupied]).max(axis=1)
    assert farthest == pytest.approx(2.0, abs=1e-3)
    assert np.abs(hits.points_xz[~hits.is_occupied]).max() <= 2.0 + 1e-3


def test_world_and_egocentric_points_differ_by_the_pose(box_room) -> None:
    pose = camera_pose((1.0, 1.25, 0.5), -2.0)
    depth = make_depth_camera(box_room(), CAMERA).render(pose)
    ego = project_depth(depth, CAMERA, ALL_PIXELS).points_xz
    world = project_depth(depth, CAMERA, ALL_PIXELS, pose).points_xz
    expected = ego @ pose[np.ix_([0, 2], [0, 2])].T + pose[[0, 2], 3]
    assert world == pytest.approx(expected, abs=1e-5)


def test_tilted_camera_is_refused() -> None:
    pose = camera_pose((0.0, 1.25, 0.0), 0.0)
    pose[1:3, 1:3] = [[np.cos(0.2), -np.sin(0.2)], [np.sin(0.2), np.cos(0.2)]]
    with pytest.raises(
        ValueError, match=r"`world_from_camera` must be level, got an up axis with y = 0\.980"
    ):
        project_depth(wall_at(2.0), CAMERA, ALL_PIXELS, pose)


def test_points_beyond_the_raster_are_dropped_not_clamped() -> None:
    hits = project_depth(wall_at(2.0), CAMERA, ALL_PIXELS)
    counts = count_hits(hits, GridFrame((-0.5, -1.9), 0.1, (19, 10)))
    assert counts[0].sum() == 0
    whole = count_hits(hits, ego_frame(60, 0.1, is_centred=True))
    assert whole.sum() == len(hits.points_xz)


def test_one_obstacle_point_is_sixty_per_cent_and_no_point_is_uniform() -> None:
    counts = np.zeros((2, 1, 2), np.int32)
    counts[0, 0, 0] = 1
    probabilities = class_probabilities(counts)
    assert probabilities[:, 0, 0] == pytest.approx([0.2, 0.6, 0.2])
    assert probabilities[:, 0, 1] == pytest.approx(1.0 / 3.0)


def test_masks_are_grown_as_occant_grows_them() -> None:
    counts = np.zeros((2, 21, 21), np.int32)
    counts[0, 10, 10] = 1
    occupied, explored = seen_masks(counts, PRESETS["occant"])
    assert occupied.sum() == explored.sum() == 5 * 5
    counts[:, 10, 10] = (0, 1)
    occupied, explored = seen_masks(counts, PRESETS["occant"])
    assert (occupied.sum(), explored.sum()) == (0, 9 * 9)
    assert seen_masks(counts, PRESETS["ans"])[1].sum() == 1


def test_large_image_is_thinned_evenly() -> None:
    camera = CameraSpec(width_px=256, height_px=256)
    hits = project_depth(
        np.full((256, 256), 2.0, np.float32), camera, replace(ALL_PIXELS, obstacle_max_m=9.0)
    )
    assert len(hits.points_xz) == 128 * 128
    assert abs(hits.points_xz[:, 0].mean()) < 0.01


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"min_depth_m": 4.0}, r"`min_depth_m` must be in \[0, max_depth_m\), got 4.0 of 3.0"),
        ({"obstacle_min_m": 2.0}, r"`obstacle_min_m` must be in \(0, obstacle_max_m\), got 2.0 of 1.5"),
        ({"min_points": 0}, "`min_points` must be >= 1, got 0"),
    ],
)
def test_senseless_settings_are_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ProjectionSettings(**options)


def test_closed_room_has_no_obstacle_inside(two_rooms: TriangleMesh) -> None:
    pose = camera_pose((-2.0, 1.25, 0.0), 0.0)
    depth = make_depth_camera(two_rooms, CAMERA).render(pose)
    frame = GridFrame((-4.0, -2.0), 0.1, (40, 80))
    occupied, free = count_hits(project_depth(depth, CAMERA, PRESETS["upen"], pose), frame)
    assert not occupied[2:-2, 2:38].any()
    assert free[:15, 15:25].any()
