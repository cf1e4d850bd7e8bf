import sys

import numpy as np
import pytest

from anm_gym.errors import BackendError
from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.sim.backends import make_depth_camera
from anm_gym.sim.warp_camera import WarpCamera

POSES = np.stack([camera_pose((x, 1.25, 0.2 * x), 1.7 * x) for x in (-2.6, -1.1, 0.9, 2.2)])


def agree(mesh, device):
    """Compare Warp and Embree away from the edges of triangles."""
    spec = CameraSpec(width_px=96, height_px=96)
    embree, warp = (make_depth_camera(mesh, spec), WarpCamera(mesh, spec, device))
    for pose, image in zip(POSES, warp.render(POSES), strict=True):
        same = embree.render_triangles(pose) == warp.render_triangles(pose)
        assert same.mean() > 0.99
        np.testing.assert_allclose(image[same], embree.render(pose)[same], atol=1e-5)


def test_warp_and_embree_agree_to_a_hundredth_of_a_millimetre(two_rooms):
    pytest.importorskip("warp")
    agree(two_rooms, "cpu")


@pytest.mark.gpu
def test_warp_and_embree_agree_on_a_gpu(two_rooms):
    pytest.importorskip("warp")
    agree(two_rooms, "cuda:0")


def test_the_image_can_stay_on_the_device_as_a_tensor(two_rooms):
    pytest.importorskip("warp")
    camera = WarpCamera(two_rooms, CameraSpec(width_px=16, height_px=12), "cpu")
    batch, single = camera.render_torch(POSES), camera.render_torch(POSES[1])
    assert tuple(batch.shape) == (4, 12, 16)
    np.testing.assert_array_equal(batch.numpy(), camera.render(POSES))
    np.testing.assert_array_equal(single.numpy(), camera.render(POSES[1]))


def test_an_unknown_device_is_refused_with_the_choices(two_rooms):
    pytest.importorskip("warp")
    with pytest.raises(BackendError, match=r"`device` must be one of: cpu.*, got 'tpu:3'"):
        WarpCamera(two_rooms, CameraSpec(), "tpu:3")


def test_without_warp_the_error_names_the_remedy(two_rooms, monkeypatch):
    monkeypatch.setitem(sys.modules, "warp", None)
    with pytest.raises(BackendError, match="pip install warp-lang"):
        WarpCamera(two_rooms, CameraSpec(), "cpu")
