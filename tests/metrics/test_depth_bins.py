import numpy as np
import pytest

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.metrics.depth_bins import DepthBins
from anm_gym.metrics.depth_view import depth_view

REACH_M = 0.05


def bins_of(depth):
    camera = CameraSpec(depth.shape[1], depth.shape[0])
    return DepthBins(depth_view(depth, camera, camera_pose([0, 0, 0], 0.0)), REACH_M)


@pytest.mark.parametrize("shape", [(64, 64), (37, 50), (3, 5)])
def test_no_pixel_in_reach_is_ever_ruled_out(rng, shape):
    depth = rng.uniform(1.0, 4.0, shape).astype(np.float32)
    row, column = rng.uniform(-3, shape[0] + 3, 400), rng.uniform(-3, shape[1] + 3, 400)
    radius, query = rng.uniform(0.0, 60.0, 400), rng.uniform(0.5, 5.0, 400)
    rows, columns = np.arange(shape[0]), np.arange(shape[1])
    expected = [
        (
            (np.abs(rows[:, None] - r) <= size)
            & (np.abs(columns[None] - c) <= size)
            & (np.abs(depth - d) <= REACH_M)
        ).any()
        for r, c, size, d in zip(row, column, radius, query, strict=True)
    ]
    arrays = (array.astype(np.float32) for array in (row, column, radius, query))
    may_touch = bins_of(depth).may_touch(*arrays)
    assert may_touch[np.array(expected)].all()


def test_what_is_far_behind_a_wall_is_ruled_out():
    depth = np.full((64, 64), 2.0, np.float32)
    place, radius = np.full(2, 32.0, np.float32), np.full(2, 3.0, np.float32)
    queries = np.array([2.5, 1.5], np.float32)
    assert not bins_of(depth).may_touch(place, place, radius, queries).any()


def test_empty_pixels_touch_nothing():
    depth = np.zeros((64, 64), np.float32)
    place, radius = np.full(1, 32.0, np.float32), np.full(1, 3.0, np.float32)
    assert not bins_of(depth).may_touch(place, place, radius, np.full(1, 0.04, np.float32)).any()
