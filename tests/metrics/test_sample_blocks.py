import numpy as np
import pytest

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.metrics.depth_view import depth_view
from anm_gym.metrics.sample_blocks import SampleBlocks


def test_values_come_back_in_the_given_order(rng):
    points = rng.uniform(-5, 5, (300, 3))
    camera, pose = CameraSpec(32, 32), camera_pose([0, 0, 0], 0.0)
    view = depth_view(np.full((32, 32), 4.0, np.float32), camera, pose)
    blocks = SampleBlocks(points)
    found = blocks.in_view(view, 0.05)
    marks = np.zeros(len(blocks), bool)
    marks[found.index] = True
    given = blocks.in_given_order(marks)
    on_wall = (np.abs(points[:, 2] + 4.0) <= 0.05) & (np.abs(points[:, :2]) < 3.5).all(axis=1)
    assert given[on_wall].all()
    assert (np.abs(points[given, 2] + 4.0) <= 0.05 + 1e-5).all()


def test_camera_points_are_x_y_and_depth():
    camera, pose = CameraSpec(32, 32), camera_pose([1.0, 0.0, 0.0], np.pi / 2)
    view = depth_view(np.full((32, 32), 2.0, np.float32), camera, pose)
    found = SampleBlocks(np.array([[-1.0, 0.3, 0.2]])).in_view(view, 0.05)
    assert np.allclose(found.camera_points[:, 0], [-0.2, 0.3, 2.0], atol=1e-6)


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.zeros((4, 2)), np.zeros(3)])
def test_points_of_another_shape_are_refused(points):
    with pytest.raises(ValueError, match=r"`points` must have shape \(N, 3\) with N > 0"):
        SampleBlocks(points)
