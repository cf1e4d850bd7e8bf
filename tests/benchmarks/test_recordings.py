"""Recorded walks are the same for every map."""

import numpy as np
import pytest

from benchmarks.recordings import record


@pytest.fixture(scope="module")
def walk():
    return record("home:studio:11", 3, seed=2)


def test_a_walk_has_one_image_per_step_and_one_pose_each(walk):
    assert len(walk) == len(walk.world_from_camera) == 3
    assert walk.depth_m.shape[1:] == (walk.camera.height_px, walk.camera.width_px)
    assert (walk.name, walk.seed, walk.scene.name) == ("home:studio:11-2", 2, "home:studio:11")


def test_the_same_walk_is_the_same_bit_for_bit(walk):
    again = record("home:studio:11", 3, seed=2)
    np.testing.assert_array_equal(walk.depth_m, again.depth_m)
    np.testing.assert_array_equal(walk.world_from_camera, again.world_from_camera)
