"""Boxes around patches of pixels: they hold every point, and no farther patch is called near."""

import numpy as np
import pytest

from anm_gym.geometry import CameraSpec
from anm_gym.metrics.depth_patches import PATCH_PX, DepthPatches
from anm_gym.metrics.depth_view import DepthView, depth_view

RADIUS_M = 0.05


def view_of(depth_m: np.ndarray) -> DepthView:
    height, width = depth_m.shape
    return depth_view(depth_m.astype(np.float32), CameraSpec(width, height), np.eye(4))


def patch_distances(view: DepthView, sample: np.ndarray) -> np.ndarray:
    """Distance of a sample (x, y, depth) to the nearest point of each patch, by brute force."""
    points = view.directions * view.depth_m[..., None] * [1.0, 1.0, -1.0]
    distance = np.where(view.is_valid, np.linalg.norm(points - sample, axis=-1), np.inf)
    height, width = distance.shape
    return np.array(
        [
            [
                distance[row : row + PATCH_PX, column : column + PATCH_PX].min()
                for column in range(0, width, PATCH_PX)
            ]
            for row in range(0, height, PATCH_PX)
        ]
    ).ravel()


@pytest.mark.parametrize("shape", [(16, 16), (18, 13)])
def test_patch_with_a_point_in_reach_is_never_ruled_out(
    shape: tuple[int, int], rng: np.random.Generator
) -> None:
    depth_m = rng.uniform(0.5, 1.5, (1, shape[1])) + rng.normal(0.0, 0.05, shape)
    depth_m[rng.random(shape) < 0.2] = 0.0
    depth_m[:PATCH_PX, :PATCH_PX] = 0.0
    view = view_of(depth_m)
    patches = DepthPatches(view)
    numbers = np.arange(patches.columns * -(-shape[0] // PATCH_PX))
    near, ruled_out = 0, 0
    for row, column in rng.integers(0, shape, (200, 2)):
        sample = view.directions[row, column] * (depth_m[row, column] or 1.0) * [1.0, 1.0, -1.0]
        sample = (sample + rng.normal(0.0, 0.03, 3)).astype(np.float32)
        points = np.repeat(sample[:, None], len(numbers), axis=1)
        reached = patches.in_reach(numbers, points, np.full(len(numbers), RADIUS_M, np.float32))
        is_near = patch_distances(view, sample) < RADIUS_M
        assert not (is_near & ~reached).any()
        assert not reached[0], "an empty patch is beyond everything"
        near, ruled_out = near + is_near.sum(), ruled_out + (~reached).sum()
    assert near > 10
    assert ruled_out > 0.5 * 200 * len(numbers)
