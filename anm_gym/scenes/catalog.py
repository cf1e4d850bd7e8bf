"""One string names any scene: a mesh file, a dataset's scene, a floor plan, or a procedural home."""

import re
from typing import Any, Final

from anm_gym.errors import BackendError, SceneError
from anm_gym.scenes.datasets import is_dataset_scene, load_dataset_scene
from anm_gym.scenes.load import load_scene
from anm_gym.scenes.procedural.home import make_home
from anm_gym.scenes.procedural.tiers import TIERS
from anm_gym.scenes.scene import Scene

HOME_PREFIX: Final = "home:"
"""What the name of a procedural home begins with."""
_SEED: Final = re.compile(r"0|[1-9][0-9]{0,17}")


def make_scene(spec: str, **options: Any) -> Scene:
    """Make a scene from its name; nothing is cached.

    Args:
        spec: A mesh file (``.glb .gltf .obj .ply .stl``), a floor plan (``.json``), a scene of a dataset
            such as ``gibson:Denmark``, or a procedural home ``"home:<tier>:<seed>"`` with a tier of
            ``studio``, ``flat``, ``house`` and ``maze``.
        options: For a mesh file, the keywords of `load_scene`; for a dataset's scene those of
            `load_dataset_scene`; the others take none.

    Raises:
        TypeError: If an option does not exist for this kind of scene.
        SceneError: If the name or the file cannot be used; the message says why.
        BackendError: If a floor plan needs a package that is not installed.

    Example:
        >>> make_scene("home:studio:3").name
        'home:studio:3'
    """
    name = str(spec)
    if is_dataset_scene(name):
        return load_dataset_scene(name, **options).scene
    if takes_options(name):
        return load_scene(name, **options)
    if options:
        raise TypeError(
            f"`options` must be empty for {name!r}, got {', '.join(options)}; only mesh files take any"
        )
    return _make_home(name) if name.startswith(HOME_PREFIX) else _make_plan(name)


def takes_options(spec: str) -> bool:
    """Tell whether a scene is made with options: a mesh, that is, and neither a home nor a floor plan."""
    return not str(spec).startswith(HOME_PREFIX) and not str(spec).lower().endswith(".json")


def _make_home(name: str) -> Scene:
    tier, _, seed = name.removeprefix(HOME_PREFIX).partition(":")
    if tier not in TIERS:
        raise SceneError(f"the tier in {name!r} must be one of {', '.join(TIERS)}, got {tier!r}")
    if not _SEED.fullmatch(seed):  # one home has one name, so no leading zeros
        raise SceneError(
            f"the seed in {name!r} must be an integer >= 0 of at most 18 digits, without leading zeros, "
            f"got {seed!r}; e.g. 'home:{tier}:7'"
        )
    return make_home(tier, int(seed))


def _make_plan(name: str) -> Scene:
    try:
        from anm_gym.scenes.floorplan import load_floorplan
    except ImportError as error:
        raise BackendError(f"floor plans need {error.name}; pip install 'anm-gym[plans]'") from error
    return load_floorplan(name)
