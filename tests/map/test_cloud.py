import numpy as np
import pytest
import torch

from anm_gym.map import cloud as cloud_module
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


def test_points_are_near_within_the_radius(rng: np.random.Generator) -> None:
    cloud = SurfaceCloud()
    cloud.add(rng.random((300, 3)).astype(np.float32))
    queries = rng.uniform(-0.5, 1.5, (400, 3)).astype(np.float32)
    assert np.array_equal(cloud.is_near(queries, 0.2), cloud.distance_of(queries) <= 0.2)
    assert cloud.is_near(np.array([[0.0, 0.0, 5.0]]), 0.2).tolist() == [False]


def test_voxels_stay_known_when_there_are_more_than_are_remembered(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cloud_module, "RECENT_BITS", 4)
    cloud, points = SurfaceCloud(voxel_m=0.1), rng.random((5000, 3)).astype(np.float32)
    kept = sum(cloud.add(part) for part in np.array_split(points, 10))
    assert kept == len(cloud) == len(np.unique(np.floor(points / 0.1).astype(int), axis=0))
    assert cloud.add(points) == 0


def test_distances_from_all_pairs_are_those_of_the_tree(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cloud_module, "PAIRS_AT_ONCE", 1000)
    cloud = SurfaceCloud()
    for _ in range(3):
        cloud.add(rng.random((50, 3)).astype(np.float32))
        sent = cloud._points_on(torch.device("cpu"))
        assert np.array_equal(sent.numpy(), cloud.points)
        queries = torch.from_numpy(rng.random((40, 3)).astype(np.float32))
        nearest = cloud_module._nearest_distance(queries, sent)
        assert torch.allclose(nearest, torch.from_numpy(cloud.distance_of(queries.numpy())), atol=1e-6)
    assert torch.isinf(cloud_module._nearest_distance(queries, sent[:0])).all()
    assert len(cloud_module._nearest_distance(queries[:0], sent)) == 0


@pytest.mark.gpu
def test_distances_on_the_gpu_are_those_on_the_cpu(rng: np.random.Generator) -> None:
    cloud = SurfaceCloud()
    cloud.add(rng.random((500, 3)).astype(np.float32))
    queries = torch.from_numpy(rng.random((40, 3)).astype(np.float32))
    assert torch.allclose(cloud.distance(queries.cuda()).cpu(), cloud.distance(queries), atol=1e-5)
