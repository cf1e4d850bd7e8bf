import gc
import sys

import numpy as np
import pytest

from anm_gym.errors import BackendError
from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.mesh import TriangleMesh
from anm_gym.sim import color
from anm_gym.sim.color import ColorCamera

SPEC = CameraSpec(width_px=64, height_px=48)
POSE = camera_pose((0.0, 1.25, 0.0), 0.0)


def painted(mesh: TriangleMesh, rgb) -> TriangleMesh:
    return TriangleMesh(mesh.vertices, mesh.faces, np.tile(np.array(rgb, np.uint8), (len(mesh.faces), 1)))


@pytest.mark.render
def test_a_red_ball_is_red_on_white(sphere):
    picture = ColorCamera(painted(sphere, (220, 0, 0)), SPEC).render(POSE)
    assert picture.shape == (48, 64, 3)
    assert picture.dtype == np.uint8
    red, green, blue = picture[24, 32].tolist()
    assert red > 100
    assert max(green, blue) < 30
    assert picture[0, 0].tolist() == [255, 255, 255]


@pytest.mark.render
def test_the_picture_shows_what_the_depth_camera_sees(sphere, make_camera):
    picture = ColorCamera(painted(sphere, (0, 0, 200)), SPEC).render(camera_pose((0.3, 1.0, 0.0), 0.3))
    depth = make_camera(sphere, width_px=64, height_px=48).render(camera_pose((0.3, 1.0, 0.0), 0.3))
    differs = (picture[..., 0] < 128) != (depth > 0)
    assert differs.mean() < 0.01, "only pixels on the outline may differ"


@pytest.mark.render
def test_a_mesh_without_colours_is_painted_by_its_normals(box_room):
    picture = ColorCamera(box_room(), SPEC).render(camera_pose((0.0, 1.25, 0.0), 0.5))
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 3


@pytest.mark.render
def test_a_camera_outlives_another_that_is_deleted(box_room, sphere):
    kept = ColorCamera(box_room(), SPEC)
    before = kept.render(POSE)
    other = ColorCamera(sphere, CameraSpec(width_px=20, height_px=20))
    assert other.render(POSE).shape == (20, 20, 3)
    del other
    gc.collect()
    np.testing.assert_array_equal(kept.render(POSE), before)


def test_without_pyrender_the_error_names_the_remedy(sphere, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyrender", None)
    with pytest.raises(BackendError, match="apt-get install libegl1 libgl1-mesa-dri"):
        ColorCamera(sphere, SPEC)


def test_without_egl_the_error_names_the_remedy(monkeypatch):
    class NoEgl:
        @staticmethod
        def OffscreenRenderer(width, height):
            raise OSError("libEGL.so: cannot open shared object file")

    monkeypatch.setattr(color, "_import_pyrender", NoEgl)
    with pytest.raises(BackendError, match=r"colour needs a working EGL.*apt-get install libegl1"):
        color._shared_renderer.__wrapped__()
