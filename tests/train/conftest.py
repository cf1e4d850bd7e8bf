"""A tiny scene on the disk, a cache of its own for the commands, a map that is exactly right."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.settings import MapSettings
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.backends import make_depth_camera
from train.run_folder import LOCK_FILE


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory):
    """Keep the user's cache out of the tests; worker processes inherit the variable."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ANM_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture
def held() -> Callable[[Path], AbstractContextManager[None]]:
    """Give `with held(folder)`: another process writes to a folder meanwhile."""

    @contextmanager
    def holding(folder: Path) -> Iterator[None]:
        lines = (
            "from filelock import FileLock",
            f"lock = FileLock({str(folder / LOCK_FILE)!r})",
            "lock.acquire()",
            "print(flush=True)",
            "input()",
        )
        command = [sys.executable, "-c", "\n".join(lines)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
            assert other.stdout is not None
            other.stdout.readline()
            yield
            other.communicate("\n")

    return holding


@pytest.fixture(scope="session")
def room_file(tmp_path_factory, box_room) -> Path:
    """Write a closed room of 4 x 3 m, y up."""
    room = box_room(4.0, 3.0)
    path = tmp_path_factory.mktemp("scenes") / "room.ply"
    trimesh.Trimesh(room.vertices, room.faces, process=False).export(path)
    return path


class KnownMap(NeuralMap):
    """A map that has seen half of a room of 4 x 2.5 x 3 m; it predicts the true distance, plus an error."""

    def __init__(self, room, error=lambda points: 0.0):
        camera = CameraSpec(64, 64)
        super().__init__(MapSettings(), camera)
        self.room, self.error = room, error
        renderer = make_depth_camera(room, camera)
        for heading_rad in (-0.8, 0.0, 0.8):
            pose = camera_pose((0.0, 1.25, 0.0), heading_rad)
            depth_m = renderer.render(pose)
            self.frames.append(torch.from_numpy(depth_m), torch.from_numpy(pose).float())
            self._log(depth_m, pose)

    def sdf(self, points):
        inside = np.array([2.0, 1.25, 1.5]) - np.abs(points - np.array([0.0, 1.25, 0.0]))
        return (inside.min(axis=1) + self.error(points)).astype(np.float32)

    def variability(self, points):
        """The squared error."""
        return np.broadcast_to(np.square(self.error(points)), len(points)).astype(np.float32)

    def mesh(self):
        return TriangleMesh(self.room.vertices, self.room.faces)


@pytest.fixture(scope="session")
def known_map(box_room):
    """Give `build(error)`: a map of a room of 4 x 3 m, wrong by `error(points)` metres."""
    return lambda *error: KnownMap(box_room(4.0, 3.0, 2.5), *error)


@pytest.fixture(scope="session")
def twin_rooms():
    """Give two rooms of 3 x 3 m as a raster of heights, with a door 1 m wide at x = 3, z = 1.5 m."""
    from scipy import ndimage

    from anm_gym.sim.grid import GridFrame
    from train.occant.twin_world import TwinWorld

    top_m = np.full((32, 62), 1.5, np.float32)
    top_m[1:-1, 1:30] = top_m[1:-1, 31:61] = top_m[11:21, 30] = 0.0
    clearance = ndimage.distance_transform_edt(top_m == 0.0)
    return TwinWorld("two rooms", GridFrame((0.0, 0.0), 0.1, top_m.shape), top_m, clearance > 1.0)
