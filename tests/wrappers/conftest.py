"""Exploration environments in scenes of a few triangles."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

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
