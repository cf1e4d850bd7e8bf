import numpy as np
import pytest
from scipy.spatial import cKDTree

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.metrics.depth_view import depth_view
from anm_gym.metrics.nearest_observed import NearestObserved
from anm_gym.metrics.sample_blocks import SampleBlocks

REACH_M = 0.05


def bumpy_depth(rng, shape, nearest_m):
    """Steps, slopes, holes: everything that breaks the smoothness of an image."""
    rows, columns = np.indices(shape)
    depth = nearest_m + 0.03 * rows + 0.8 * ((columns // 9 + rows // 7) % 3) + rng.uniform(0, 0.02, shape)
    depth[rng.random(shape) < 0.05] = 0.0
    return depth.astype(np.float32)


@pytest.mark.parametrize(("shape", "hfov_deg", "nearest_m"), [((64, 64), 90.0, 0.9), ((45, 70), 60.0, 0.08)])
@pytest.mark.parametrize("max_side_px", [70, 23])
def test_distances_equal_those_of_a_search_of_all_points(rng, shape, hfov_deg, nearest_m, max_side_px):
    camera = CameraSpec(shape[1], shape[0], hfov_deg=hfov_deg)
    poses = [camera_pose([0.1 * step, 1.25, -0.2 * step], 0.3 * step) for step in range(4)]
    views = [depth_view(bumpy_depth(rng, shape, nearest_m), camera, pose) for pose in poses]
    views = [view.thinned(max_side_px) for view in views]
    seen = np.concatenate([view.points for view in views]).astype(np.float64)
    near = seen[rng.integers(len(seen), size=3000)] + rng.normal(0, 0.04, (3000, 3))
    samples = np.concatenate([near, rng.uniform(-4, 4, (1000, 3))])
    nearest = NearestObserved(SampleBlocks(samples), REACH_M)
    for view in views:
        nearest.observe(view)
    expected, _ = cKDTree(seen).query(samples)
    decided = np.abs(expected - REACH_M) > 1e-5
    assert np.array_equal(nearest.covered[decided], expected[decided] < REACH_M)
    assert 500 < nearest.num_covered < 3500
    covered = nearest.covered & decided
    assert np.allclose(nearest.distance_m[covered], expected[covered], atol=1e-5)
    assert np.isinf(nearest.distance_m[~nearest.covered]).all()


def test_an_empty_frame_observes_nothing():
    nearest = NearestObserved(SampleBlocks(np.zeros((1, 3))), REACH_M)
    camera = CameraSpec(16, 16)
    nearest.observe(depth_view(np.zeros((16, 16), np.float32), camera, camera_pose([0, 0, 0], 0.0)))
    assert nearest.num_covered == 0


def test_what_lies_behind_the_camera_stays_uncovered():
    samples = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    nearest = NearestObserved(SampleBlocks(samples), REACH_M)
    camera = CameraSpec(65, 65)
    nearest.observe(depth_view(np.ones((65, 65), np.float32), camera, camera_pose([0, 0, 0], 0.0)))
    assert nearest.covered.tolist() == [True, False]
    assert nearest.distance_m[0] == pytest.approx(0.0, abs=1e-6)


def test_bad_arguments_are_refused():
    with pytest.raises(ValueError, match="`reach_m` must be > 0"):
        NearestObserved(SampleBlocks(np.zeros((1, 3))), 0.0)
