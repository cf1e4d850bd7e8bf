"""Exploration environments in scenes of a few triangles."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from anm_gym.envs.explore import ExploreEnv
from anm_gym.mesh import TriangleMesh


@pytest.fixture
def explore(tmp_path: Path) -> Callable[..., ExploreEnv]:
    """Give `explore(mesh, start=(x, z, heading))`: an environment with an image of 64 x 64 pixels."""

    def build(mesh: TriangleMesh, **options: Any) -> ExploreEnv:
        path = tmp_path / "scene.ply"
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(path)
        camera = {"width_px": 64, "height_px": 64}
        return ExploreEnv(str(path), scene_options={"up_axis": "y"}, camera=camera, **options)

    return build


@pytest.fixture(scope="session")
def with_step() -> Callable[..., TriangleMesh]:
    """Give `with_step(mesh, x_m, z_m, height_m)`: the mesh and a box on its floor."""

    def add(
        mesh: TriangleMesh, x_m: tuple[float, float], z_m: tuple[float, float], height_m: float
    ) -> TriangleMesh:
        low, high = (x_m[0], 0.0, z_m[0]), (x_m[1], height_m, z_m[1])
        box = trimesh.creation.box(bounds=[low, high])
        vertices = np.concatenate([mesh.vertices, box.vertices])
        faces = np.concatenate([mesh.faces, box.faces + len(mesh.vertices)])
        return TriangleMesh(vertices, faces.astype(np.int32))

    return add
