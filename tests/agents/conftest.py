"""Exploration environments in scenes of a few triangles."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import trimesh
from torch import Tensor, nn

from agents.upen_ensemble import Ensemble, EnsembleSettings
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


class Guess(nn.Module):
    """A predictor that believes what it sees, and one class of what it does not."""

    def __init__(self, label: int) -> None:
        super().__init__()
        self.label = label

    def forward(self, raster: Tensor) -> Tensor:
        unseen = raster.amax(dim=1) < 0.34
        logits = 4.0 * raster
        logits[:, self.label] = torch.where(unseen, 4.0, logits[:, self.label])
        return logits


@pytest.fixture(scope="session")
def guessing() -> Callable[..., Ensemble]:
    """Give `guessing(*labels)`: UPEN's ensemble with one member for each class that it guesses."""

    def build(*labels: int) -> Ensemble:
        settings = EnsembleSettings(members=len(labels), crop_cells=32)
        return Ensemble(settings, [Guess(label) for label in labels])

    return build
