import numpy as np
import pytest
from scipy.spatial import cKDTree

from anm_gym.metrics.observed_cloud import ObservedCloud

BOUNDS = np.array([[0.0, 0.0, 0.0], [2.0, 2.0, 2.0]])


def test_distances_exceed_the_truth_by_at_most_the_bound(rng):
    points = rng.uniform(0, 2, (5000, 3)).astype(np.float32)
    queries = rng.uniform(-1, 3, (500, 3))
    cloud = ObservedCloud(BOUNDS, voxel_m=0.1)
    cloud.add(points[:2500])
    cloud.add(points[2500:])
    truth, _ = cKDTree(points).query(queries)
    excess = cloud.distance_m(queries) - truth
    assert len(cloud.points) < len(points)
    assert excess.min() > -1e-6
    assert 0.0 < excess.max() <= cloud.bound_m


def test_one_point_per_voxel_is_kept_and_it_is_the_first():
    cloud = ObservedCloud(BOUNDS, voxel_m=0.5)
    cloud.add(np.array([[0.1, 0.1, 0.1], [0.2, 0.1, 0.1], [1.9, 0.1, 0.1]], np.float32))
    cloud.add(np.array([[0.15, 0.1, 0.1]], np.float32))
    assert np.allclose(cloud.points, [[0.1, 0.1, 0.1], [1.9, 0.1, 0.1]])


def test_an_empty_cloud_is_at_the_cap():
    cloud = ObservedCloud(BOUNDS)
    assert cloud.distance_m(np.zeros((2, 3)), cap_m=1.0).tolist() == [1.0, 1.0]
    assert np.isinf(cloud.distance_m(np.zeros((1, 3)))).all()


def test_a_large_box_gets_larger_voxels():
    cloud = ObservedCloud(np.array([[0.0, 0, 0], [9.0, 9.0, 9.0]]), voxel_m=0.02, max_voxels=1000)
    assert cloud.voxel_m == pytest.approx(1.0)
