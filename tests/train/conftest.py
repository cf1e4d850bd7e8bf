"""A tiny scene on the disk and a cache of its own for the commands."""

from pathlib import Path

import pytest
import trimesh


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory):
    """Keep the user's cache out of the tests; worker processes inherit the variable."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ANM_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session")
def room_file(tmp_path_factory, box_room) -> Path:
    """Write a closed room of 4 x 3 m, y up."""
    room = box_room(4.0, 3.0)
    path = tmp_path_factory.mktemp("scenes") / "room.ply"
    trimesh.Trimesh(room.vertices, room.faces, process=False).export(path)
    return path
