"""Scenes and worlds shared by the environments of one process: making them costs far more than the rest.

A scene never changes once it is made, so sharing is safe, across threads too. What is known of its
floor and the camera over it are shared by way of a simulator that no agent stands in; every
environment has a twin of it.
"""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Final
from weakref import WeakKeyDictionary, WeakValueDictionary

from anm_gym.geometry import CameraSpec
from anm_gym.scenes.catalog import HOME_PREFIX, make_scene, takes_options
from anm_gym.scenes.datasets import find_scene, is_dataset_scene
from anm_gym.scenes.scene import Scene
from anm_gym.sim.simulator import Simulator
from anm_gym.sim.traversable import TraversableGrid

NUM_SCENES = 8
"""How many scenes a process keeps beside those that environments are in."""

Options = tuple[tuple[str, Any], ...]
Version = tuple[str, int] | None
SceneKey = tuple[str, Options, Version]
_in_use: Final[WeakValueDictionary[SceneKey, Scene]] = WeakValueDictionary()
_worlds: Final[WeakKeyDictionary[Scene, dict[tuple[CameraSpec, str, str], Simulator]]] = WeakKeyDictionary()
_grids: Final[WeakKeyDictionary[Scene, TraversableGrid]] = WeakKeyDictionary()


def shared_scene(name: str, options: Mapping[str, Any] | None = None) -> Scene:
    """Make a scene, or hand out the one that was made before; a file that has changed is read again.

    Args:
        name: See `anm_gym.scenes.catalog.make_scene`.
        options: Keywords for a mesh file; homes and floor plans, which know all that, are made without.

    Raises:
        SceneError: If the scene cannot be used.
    """
    chosen = options if options and takes_options(name) else {}
    key = (str(name), tuple(sorted(chosen.items())), _version(str(name), chosen))
    scene = _in_use.get(key)
    if scene is None:
        scene = _in_use[key] = _make(*key)
    return scene


def shared_simulator(
    scene: Scene,
    camera: CameraSpec,
    *,
    backend: str,
    device: str,
    forward_step_m: float,
    turn_step_deg: float,
) -> Simulator:
    """Make the agent's world in a scene; grid and camera are shared with others of the same kind.

    Args:
        scene: The scene.
        camera: The depth camera.
        backend: What casts the rays.
        device: Where a `warp` camera runs.
        forward_step_m: Length of this agent's forward step, metres.
        turn_step_deg: Angle of its turn, degrees.

    Raises:
        SceneError: If the storey has no floor, or is too large.
        BackendError: If the back end is missing.
    """
    worlds = _worlds.setdefault(scene, {})
    key = (camera, backend, device)
    if key not in worlds:
        worlds[key] = Simulator(
            scene.mesh, scene.floor_y_m, camera, backend=backend, device=device, grid=shared_grid(scene)
        )
    return worlds[key].twin(forward_step_m, turn_step_deg)


def shared_grid(scene: Scene) -> TraversableGrid:
    """Make the grid of where the agent's body fits in a scene, or hand out the one that was made before.

    Args:
        scene: The scene; it need not be one of `shared_scene`.

    Raises:
        SceneError: If the storey has no floor, or is too large.
    """
    if scene not in _grids:
        _grids[scene] = TraversableGrid.from_mesh(scene.mesh, scene.floor_y_m)
    return _grids[scene]


def _version(name: str, options: Mapping[str, Any]) -> Version:
    """Which file a name stands for, and when that was changed; None for a home, which never does."""
    if name.startswith(HOME_PREFIX):
        return None
    path = find_scene(name, options.get("root")) if is_dataset_scene(name) else Path(name)
    return (str(path), path.stat().st_mtime_ns) if path.is_file() else None


@lru_cache(maxsize=NUM_SCENES)
def _make(name: str, options: Options, _file: Version) -> Scene:
    return make_scene(name, **dict(options))
