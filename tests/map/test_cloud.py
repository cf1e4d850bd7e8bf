import numpy as np
import torch

from anm_gym.map.cloud import SurfaceCloud


def test_one_point_per_voxel_is_kept(rng: np.random.Generator) -> None:
    cloud = SurfaceCloud(voxel_m=0.1)
    points = rng.random((20_000, 3)).astype(np.float32)
    assert cloud.add(points) == len(cloud) == 1000
    assert cloud.add(points) == 0
    cells = np.unique(np.floor(cloud.points / 0.1).astype(int), axis=0)
    assert len(cells) == 1000


def test_distance_is_that_of_the_nearest_kept_point(rng: np.random.Generator) -> None:
    cloud = SurfaceCloud()
    for x in range(5):
        cloud.add(np.array([[float(x), 0.0, 0.0]], np.float32))
        queries = rng.random((20, 3)).astype(np.float32) * 5.0
        brute = np.linalg.norm(queries[:, None] - cloud.points[None], axis=2).min(axis=1)
        assert np.allclose(cloud.distance_of(queries), brute, atol=1e-5)
        assert torch.allclose(cloud.distance(torch.from_numpy(queries)), torch.from_numpy(brute), atol=1e-5)


def test_negative_coordinates_have_their_own_voxels() -> None:
    cloud = SurfaceCloud(voxel_m=1.0)
    assert cloud.add(np.array([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]], np.float32)) == 2


def test_bounds_and_restoring() -> None:
    cloud = SurfaceCloud()
    cloud.add(np.array([[-1.0, 0.0, 2.0], [3.0, 1.0, 0.0]], np.float32))
    assert np.allclose(cloud.bounds(), [[-1.0, 0.0, 0.0], [3.0, 1.0, 2.0]])
    other = SurfaceCloud()
    other.restore(cloud.points)
    assert np.array_equal(other.points, cloud.points)
    other.restore(np.empty((0, 3), np.float32))
    assert len(other) == 0
