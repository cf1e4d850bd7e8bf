import sys

import numpy as np
import pytest

from anm_gym.errors import BackendError
from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.sim.backends import make_depth_camera
from anm_gym.sim.embree import EmbreeCamera


def test_threads_do_not_change_the_image(two_rooms):
    pose = camera_pose((-2.0, 1.25, 0.0), -1.0)
    spec = CameraSpec(width_px=33, height_px=31)
    images = [EmbreeCamera(two_rooms, spec, threads).render(pose) for threads in (1, 2, 5)]
    np.testing.assert_array_equal(images[0], images[1])
    np.testing.assert_array_equal(images[0], images[2])


def test_no_ray_leaks_through_the_edges_of_a_closed_room(box_room, rng):
    camera = EmbreeCamera(box_room(), CameraSpec(width_px=128, height_px=128))
    for position in rng.uniform([-1.9, 0.1, -1.9], [1.9, 2.4, 1.9], (40, 3)):
        assert camera.render(camera_pose(position, rng.uniform(-4, 4))).all()


def test_a_camera_needs_a_thread(sphere):
    with pytest.raises(ValueError, match="`threads` must be >= 1, got 0"):
        EmbreeCamera(sphere, CameraSpec(), threads=0)


def test_embree_runs_on_no_other_device(sphere):
    with pytest.raises(ValueError, match="`device` must be 'cpu' for Embree, got 'cuda'"):
        make_depth_camera(sphere, CameraSpec(), device="cuda")


def test_without_embreex_the_error_names_the_remedy(sphere, monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)
    with pytest.raises(BackendError, match="pip install embreex"):
        EmbreeCamera(sphere, CameraSpec())
