"""Scenes of a few triangles as files, since environments are given names, and small environments in them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import trimesh

from anm_gym.envs.explore import ExploreEnv
from anm_gym.envs.pointnav import PointNavEnv
from anm_gym.mesh import TriangleMesh

TINY_CAMERA = {"width_px": 24, "height_px": 16}
Y_UP = {"up_axis": "y"}


@pytest.fixture(scope="session")
def write_mesh() -> Callable[[TriangleMesh, Path], str]:
    """Give `write(mesh, path)`, which returns the path as a scene's name."""

    def write(mesh: TriangleMesh, path: Path) -> str:
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(path)
        return str(path)

    return write


@pytest.fixture(scope="session")
def room(
    box_room: Callable[..., TriangleMesh],
    write_mesh: Callable[[TriangleMesh, Path], str],
    tmp_path_factory: pytest.TempPathFactory,
) -> str:
    """Give the file of a closed room of 4 x 4 m around the origin."""
    return write_mesh(box_room(), tmp_path_factory.mktemp("room") / "room.ply")


@pytest.fixture(scope="session")
def rooms(
    two_rooms: TriangleMesh,
    write_mesh: Callable[[TriangleMesh, Path], str],
    tmp_path_factory: pytest.TempPathFactory,
) -> str:
    """Give the file of two rooms of 4 x 4 m, joined by a door 1 m wide at x = 0."""
    return write_mesh(two_rooms, tmp_path_factory.mktemp("rooms") / "rooms.ply")


@pytest.fixture(scope="session")
def explore(room: str) -> Callable[..., ExploreEnv]:
    """Give `explore(**settings)`: exploration of the room with a tiny camera, unless told otherwise."""

    def make(**settings: Any) -> ExploreEnv:
        return ExploreEnv(**{"scene": room, "scene_options": Y_UP, "camera": TINY_CAMERA, **settings})

    return make


@pytest.fixture(scope="session")
def pointnav(rooms: str) -> Callable[..., PointNavEnv]:
    """Give `pointnav(**settings)`: point goals in the two rooms with a tiny camera."""

    def make(**settings: Any) -> PointNavEnv:
        return PointNavEnv(**{"scene": rooms, "scene_options": Y_UP, "camera": TINY_CAMERA, **settings})

    return make
