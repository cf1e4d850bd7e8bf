"""Colour pictures by pyrender through EGL: for people and as an optional observation.

The only file that imports pyrender. Depth comes from ray casting; here only colour is drawn, as
pyrender's multisampled depth is off by centimetres at edges.
"""

import os
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anm_gym.errors import BackendError
from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh

NEAR_M, FAR_M = 0.05, 100.0
REMEDY = "install EGL with `apt-get install libegl1 libgl1-mesa-dri`, or go without colour"


class ColorCamera:
    """A pinhole camera that sees the faces' colours under a head light.

    Args:
        mesh: What there is to see; without colours it is painted by its normals.
        spec: Image size and field of view.

    Raises:
        BackendError: If pyrender or EGL does not work here.
    """

    def __init__(self, mesh: TriangleMesh, spec: CameraSpec) -> None:
        self.spec = spec
        pyrender = _import_pyrender()
        self._renderer = _shared_renderer()
        self._flags = pyrender.RenderFlags.SKIP_CULL_FACES
        self._scene = pyrender.Scene(ambient_light=np.full(3, 0.35), bg_color=np.ones(4))
        self._scene.add(_primitive_mesh(pyrender, mesh))
        vertical_rad = 2.0 * float(np.arctan(spec.height_px / 2.0 / spec.focal_px))
        camera = pyrender.PerspectiveCamera(
            yfov=vertical_rad, aspectRatio=spec.width_px / spec.height_px, znear=NEAR_M, zfar=FAR_M
        )
        light = pyrender.DirectionalLight(color=np.ones(3), intensity=3.0)
        self._rig = [self._scene.add(camera), self._scene.add(light)]

    def render(self, world_from_camera: NDArray[np.floating]) -> NDArray[np.uint8]:
        """Render what a camera at a (4, 4) pose sees, (H, W, 3) uint8 RGB; white where there is nothing."""
        for node in self._rig:
            self._scene.set_pose(node, np.asarray(world_from_camera, np.float64))
        self._renderer.viewport_width, self._renderer.viewport_height = (
            self.spec.width_px,
            self.spec.height_px,
        )
        color, _ = self._renderer.render(self._scene, flags=self._flags)
        return np.array(color, np.uint8)


def _import_pyrender() -> Any:
    """Import pyrender for EGL, which must be chosen before OpenGL is first imported."""
    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    try:
        import pyrender
    except Exception as error:  # PyOpenGL raises many kinds where libraries are missing
        raise BackendError(f"colour needs pyrender and EGL, got {error!r}; {REMEDY}") from error
    return pyrender


@lru_cache(maxsize=1)
def _shared_renderer() -> Any:
    """Open the OpenGL context of this process.

    One for all cameras: pyrender ends the EGL display with any renderer that it deletes, and with it
    every other renderer of the process.
    """
    pyrender = _import_pyrender()
    try:
        return pyrender.OffscreenRenderer(1, 1)
    except Exception as error:  # the EGL of each system fails in its own way
        raise BackendError(f"colour needs a working EGL, got {error!r}; {REMEDY}") from error


def _primitive_mesh(pyrender: Any, mesh: TriangleMesh) -> Any:
    """Unshared corners, so that each face keeps its own colour and normal."""
    corners = mesh.triangles.reshape(-1, 3).astype(np.float32)
    normals = np.repeat(mesh.normals, 3, axis=0).astype(np.float32)
    colors = mesh.face_colors
    if colors is None:
        colors = (127.5 + 100.0 * mesh.normals).astype(np.uint8)
    shades = np.repeat(colors.astype(np.float32) / 255.0, 3, axis=0)
    primitive = pyrender.Primitive(positions=corners, normals=normals, color_0=shades, mode=4)
    return pyrender.Mesh(primitives=[primitive])
