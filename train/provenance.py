"""Where a row comes from: the effective settings of an agent, their hash, and the versions at work."""

import hashlib
import json
import platform
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import asdict, is_dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from shutil import which
from typing import Any, Final

import gymnasium as gym
import numpy as np
import torch

from anm_gym.map.numerics import has_fast_bfloat16
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.datasets import find_scene, is_dataset_scene
from train.command import scene_label
from train.recorder import env_layers
from train.results import SCENE_FILE, Row

PACKAGES: Final = ("anm-gym", "gymnasium", "numpy", "scipy", "torch", "embreex")
"""Packages whose version can change a number."""
ROOT: Final = Path(__file__).resolve().parents[1]
"""The checkout that holds this file, where it is one."""
CODE: Final = ("anm_gym", "agents", "train", ":!agents/weights/*.json")
"""What can change a number, as git names it: not the rows in `results`, nor what is said of weights."""

_GRID_SHIFT: Final = 0.3183
_NOT_SETTINGS: Final = frozenset(
    {
        *("env", "seed", "scene", "root", "max_episode_steps", "ensemble"),
        *("disable_env_checker", "order_enforce", "render_mode"),
    }
)
"""What rows name apart or by its identity, what belongs to one machine, and what changes no number."""


def digest(value: Any, digits: int = 12) -> str:
    """Name a value by hexadecimal digits: equal values, equal names."""
    text = json.dumps(_plain(value), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:digits]


def environment_digest(env_options: Mapping[str, Any]) -> str:
    """Name the arguments of an environment by six digits; empty where there are none.

    Where datasets lie is none of them, as it differs between machines and changes no number.
    """
    options = {name: value for name, value in _plain(env_options).items() if value != {}}
    return digest(options, 6) if options else ""


def effective_settings(env: gym.Env, policy: Any) -> dict[str, Any]:
    """Collect the settings of every wrapper and of the policy, without seed and scene.

    Args:
        env: The agent's environment with its wrappers.
        policy: The agent's policy; its `settings` are taken if it has any.

    Returns:
        Plain values by class name, outermost wrapper first.
    """
    result = {}
    for layer in env_layers(env):
        result[type(layer).__name__] = _settings_of(layer)
    result[type(policy).__name__] = _settings_of(policy)
    return {name: settings for name, settings in result.items() if settings}


def geometry_digest(mesh: TriangleMesh) -> str:
    """Name a mesh to the millimetre, so that processors that round differently agree.

    The grid of a millimetre is shifted: the coordinates of generated homes are round numbers, and would
    lie where it divides.
    """
    cells = np.floor(1000.0 * mesh.vertices + _GRID_SHIFT).astype(np.int64)
    hashed = hashlib.sha256(np.ascontiguousarray(cells).tobytes())
    hashed.update(np.ascontiguousarray(mesh.faces, np.int64).tobytes())
    return hashed.hexdigest()[:16]


def scenes_root(env_options: Mapping[str, Any] | None) -> str | None:
    """Folder of the datasets, where arguments of the environment name one."""
    root: str | None = ((env_options or {}).get("scene_options") or {}).get("root")
    return root


def file_digest(scene: str, root: str | Path | None = None) -> str:
    """Name the content of a scene's file, sixteen hexadecimal digits; empty for a scene that is generated.

    Of a `.gltf` that names other files, those are not part of it.

    Args:
        scene: Name or path.
        root: Folder of the datasets; None for $ANM_SCENES.

    Raises:
        SceneError: If it is a dataset's scene, and is not there.
    """
    path = find_scene(scene, root) if is_dataset_scene(scene) else Path(scene)
    if not path.is_file():
        return ""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:16]


def check_scene_files(
    scenes: Iterable[str], rows: Iterable[Row], path: Path, root: str | Path | None = None
) -> None:
    """Refuse to go on with rows of scenes that are other files by now.

    Args:
        scenes: Names or paths of what is to be played.
        rows: What was played already; rows without `SCENE_FILE` are taken as they are, and failed ones are no
            matter, as they are played again.
        path: Where the rows lie, for the message.
        root: Folder of the datasets; None for $ANM_SCENES.

    Raises:
        ValueError: If rows of a scene were played in another file of that name, or before it changed.
    """
    named = {scene_label(scene): scene for scene in scenes}
    files = {label: file_digest(scene, root) for label, scene in named.items()}
    for row in rows:
        played, label = None if row.get("error") else row.get(SCENE_FILE), row["scene"]
        if played is not None and label in files and played != files[label]:
            raise ValueError(
                f"the rows of {label} in {path} must come from {named[label]} as it is now, got those of "
                "another file; write to another `--out` folder, or rename the file"
            )


@cache
def versions() -> dict[str, str]:
    """Versions of Python and of the packages that make the numbers, and the commit of this one.

    And, as `map_products`, whether this processor multiplies the matrices of maps in bfloat16 or in float32:
    where settings allow the first, the numbers differ a little.
    """
    packages = {name: _version(name) for name in PACKAGES}
    products = "bfloat16" if has_fast_bfloat16(torch.device("cpu")) else "float32"
    return (
        {"python": platform.python_version()}
        | packages
        | {"map_products": products, "commit": commit_of(ROOT)}
    )


def _settings_of(owner: Any) -> dict[str, Any]:
    """Constructor arguments where they are recorded, and public attributes that are frozen dataclasses."""
    arguments = dict(getattr(owner, "_saved_kwargs", {}))
    arguments |= {name: value for name, value in vars(owner).items() if _is_settings(name, value)}
    plain = _plain(arguments)
    assert isinstance(plain, dict)
    return plain


def _is_settings(name: str, value: Any) -> bool:
    parameters = getattr(type(value), "__dataclass_params__", None)
    return not name.startswith("_") and parameters is not None and bool(parameters.frozen)


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if key not in _NOT_SETTINGS}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Path):
        return value.as_posix()
    return value if isinstance(value, str | int | float | bool | None) else type(value).__name__


def commit_of(root: Path) -> str:
    """Last commit that changed a checkout's code, with a + if that was changed since; empty elsewhere."""
    if not (root / ".git").exists() or which("git") is None:
        return ""
    git = ["git", "-C", str(root)]
    last = [*git, "log", "-1", "--format=%h", "--", *CODE]
    head = subprocess.run(last, capture_output=True, text=True, check=False)
    if head.returncode != 0 or not head.stdout.strip():
        return ""
    changes = [*git, "status", "--porcelain", "--untracked-files=all", "--", *CODE]
    status = subprocess.run(changes, capture_output=True, text=True, check=False)
    return head.stdout.strip() + ("+" if status.stdout.strip() or status.returncode != 0 else "")


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"
