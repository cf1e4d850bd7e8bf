"""Meshes and cameras of the simulator's tests."""

import numpy as np
import pytest
import trimesh

from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.backends import make_depth_camera


@pytest.fixture(scope="session")
def sphere() -> TriangleMesh:
    """Give a finely tessellated ball of radius 0.5 m around (0, 1.25, -2)."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.5)
    return TriangleMesh(ball.vertices + np.array([0.0, 1.25, -2.0]), ball.faces.astype(np.int32))


@pytest.fixture(params=["embree", "warp"])
def make_camera(request):
    """Give `make(mesh, **spec)` for each depth back end; Warp runs on its CPU device."""
    if request.param == "warp":
        pytest.importorskip("warp")
    return lambda mesh, **spec: make_depth_camera(mesh, CameraSpec(**spec), backend=request.param)
