"""Fixtures that every test may ask for, and the conditions under which marked tests run."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from anm_gym.mesh import TriangleMesh

WALL_M = 2.5
"""Height of the rooms built here, metres."""
SLOW_VARIABLE = "ANM_SLOW"
SHARED_VARIABLE = "ANM_SHARED"

Quad = NDArray[np.float64]
"""(4, 3) corners in order, metres."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help=f"run the slow tests too, as {SLOW_VARIABLE}=1 does")


def pytest_collection_modifyitems(config: pytest.Config, items: Sequence[pytest.Item]) -> None:
    runs_slow = config.getoption("--slow") or os.environ.get(SLOW_VARIABLE) == "1"
    conditions: dict[str, tuple[Callable[[], bool], str]] = {
        "slow": (lambda: runs_slow, "slow; run with --slow"),
        "gpu": (_has_cuda, "no CUDA device"),
        "render": (_has_egl, "no off-screen OpenGL (EGL)"),
        "needs_dask": (lambda: find_spec("distributed") is not None, "no dask: the extra `cluster`"),
        "needs_submitit": (lambda: find_spec("submitit") is not None, "no submitit: the extra `cluster`"),
    }
    for name, (is_met, reason) in conditions.items():
        marked = [item for item in items if name in item.keywords]
        if marked and not is_met():
            for item in marked:
                item.add_marker(pytest.mark.skip(reason=reason))


def _has_cuda() -> bool:
    import torch

    return torch.cuda.is_available()


def _has_egl() -> bool:
    """Ask in a subprocess: a failed OpenGL context would linger in this one."""
    if find_spec("pyrender") is None:
        return False
    probe = "import pyrender; pyrender.OffscreenRenderer(8, 8).delete()"
    environment = {**os.environ, "PYOPENGL_PLATFORM": "egl"}
    result = subprocess.run([sys.executable, "-c", probe], env=environment, capture_output=True, check=False)
    return result.returncode == 0


@pytest.fixture
def rng() -> np.random.Generator:
    """Give a generator with a fixed seed."""
    return np.random.default_rng(7)


@pytest.fixture(scope="session")
def shared_scenes() -> Path:
    """Give the folder of real meshes that $ANM_SHARED names; without one the test is skipped."""
    root = os.environ.get(SHARED_VARIABLE)
    if not root:
        pytest.skip(f"${SHARED_VARIABLE} names no folder of meshes")
    folder = Path(root) / "scenes"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not a folder")
    return folder


@pytest.fixture(scope="session")
def shared_floorplans(shared_scenes: Path) -> Path:
    """Give the folder of floor plans beside the real meshes, or skip."""
    folder = shared_scenes.parent / "floorplans"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not a folder")
    return folder


@pytest.fixture(scope="session")
def box_room() -> Callable[..., TriangleMesh]:
    """Give `build(width_m=4, depth_m=4, height_m=2.5)`: a closed room on y = 0 around the origin."""
    return build_box


@pytest.fixture(scope="session")
def two_rooms() -> TriangleMesh:
    """Give two rooms of 4 x 4 m, centres (-2, 0) and (2, 0), joined by a door 1 m wide at x = 0."""
    return build_rooms([(-4.0, 0.0), (0.0, 4.0)], depth_m=4.0, door_m=1.0)


@pytest.fixture(scope="session")
def corridor() -> TriangleMesh:
    """Give a closed corridor along x, 10 m long and 1.2 m wide around the origin."""
    return build_box(width_m=10.0, depth_m=1.2)


def build_box(width_m: float = 4.0, depth_m: float = 4.0, height_m: float = WALL_M) -> TriangleMesh:
    """Build a closed room with the floor at y = 0 and the origin in its middle."""
    return build_rooms([(-width_m / 2, width_m / 2)], depth_m, door_m=0.0, height_m=height_m)


def build_rooms(
    spans_x_m: Sequence[tuple[float, float]], depth_m: float, door_m: float, height_m: float = WALL_M
) -> TriangleMesh:
    """Build rooms in a row along x, each joined to the next by a gap in the wall between them.

    Args:
        spans_x_m: Lowest and highest x of each room; each begins where the one before ends.
        depth_m: Extent along z, centred on 0.
        door_m: Width of the gaps, from floor to ceiling, at z = 0.
        height_m: Height of the ceiling.
    """
    low, high, half = spans_x_m[0][0], spans_x_m[-1][1], depth_m / 2
    quads = [
        _level(low, high, -half, half, 0.0),
        _level(low, high, -half, half, height_m)[::-1],
        _wall((low, half), (low, -half), height_m),
        _wall((high, -half), (high, half), height_m),
        _wall((low, -half), (high, -half), height_m),
        _wall((high, half), (low, half), height_m),
    ]
    for _, x in spans_x_m[:-1]:
        quads.append(_wall((x, -half), (x, -door_m / 2), height_m))
        quads.append(_wall((x, door_m / 2), (x, half), height_m))
    return mesh_of_quads(quads)


def mesh_of_quads(quads: Iterable[Quad]) -> TriangleMesh:
    """Split each quad into two triangles."""
    corners = np.stack(list(quads))
    first = 4 * np.arange(len(corners))[:, None, None]
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return TriangleMesh(corners.reshape(-1, 3), faces.astype(np.int32))


def _level(low_x: float, high_x: float, low_z: float, high_z: float, y: float) -> Quad:
    """Face up, as a floor does."""
    return np.array([[low_x, y, low_z], [low_x, y, high_z], [high_x, y, high_z], [high_x, y, low_z]])


def _wall(from_xz: tuple[float, float], to_xz: tuple[float, float], height_m: float) -> Quad:
    """Face right of the way from one floor point to the other, seen from above."""
    (x0, z0), (x1, z1) = from_xz, to_xz
    return np.array([[x0, 0.0, z0], [x1, 0.0, z1], [x1, height_m, z1], [x0, height_m, z0]])
