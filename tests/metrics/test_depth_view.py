import numpy as np
import pytest

from anm_gym.geometry import CameraSpec, backproject, camera_pose
from anm_gym.metrics.depth_view import depth_view

CAMERA = CameraSpec(width_px=12, height_px=8, hfov_deg=80.0)
POSE = camera_pose([1.0, 1.25, -2.0], 0.7)


def test_points_agree_with_backprojection(rng):
    depth = rng.uniform(0.5, 5.0, (8, 12)).astype(np.float32)
    depth[2, 3] = 0.0
    points = depth_view(depth, CAMERA, POSE).points
    assert np.allclose(points, backproject(depth, CAMERA, POSE), atol=1e-5)


def test_depths_out_of_range_become_empty():
    depth = np.full((8, 12, 1), 1.0, np.float32)
    depth[0, :3, 0] = [0.05, 8.5, 8.0]
    assert depth_view(depth, CAMERA, POSE).is_valid[0, :4].tolist() == [False, False, True, True]


@pytest.mark.parametrize("max_side_px", [12, 6, 5, 1])
def test_a_pixel_index_is_where_its_own_point_projects(rng, max_side_px):
    depth = rng.uniform(0.5, 5.0, (8, 12)).astype(np.float32)
    view = depth_view(depth, CAMERA, POSE).thinned(max_side_px)
    assert max(view.depth_m.shape) <= max_side_px
    columns = view.focal * view.directions[..., 0] + view.center_column
    rows = view.center_row - view.focal * view.directions[..., 1]
    assert np.allclose(columns, np.arange(view.depth_m.shape[1])[None], atol=1e-5)
    assert np.allclose(rows, np.arange(view.depth_m.shape[0])[:, None], atol=1e-5)


def test_thinning_by_two_keeps_every_second_pixel(rng):
    depth = rng.uniform(0.5, 5.0, (8, 12)).astype(np.float32)
    assert np.array_equal(depth_view(depth, CAMERA, POSE).thinned(6).depth_m, depth[::2, ::2])


def test_an_image_of_another_size_is_refused():
    with pytest.raises(ValueError, match=r"`depth_m` must have shape \(8, 12\)"):
        depth_view(np.ones((12, 8), np.float32), CAMERA, POSE)
