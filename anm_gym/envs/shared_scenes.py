"""Scenes shared by the environments of one process: loading costs far more than the rest.

A scene never changes once it is made, so sharing is safe, across threads too. The simulator is not
shared: it holds the agent, and building it takes a tenth of a second.
"""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from anm_gym.scenes.catalog import HOME_PREFIX, make_scene
from anm_gym.scenes.scene import Scene

NUM_SCENES = 8
"""How many scenes a process keeps."""


def shared_scene(name: str, options: Mapping[str, Any] | None = None) -> Scene:
    """Make a scene, or hand out the one that was made before; a file that has changed is read again.

    Args:
        name: See `anm_gym.scenes.catalog.make_scene`.
        options: Keywords for a mesh file.

    Raises:
        SceneError: If the scene cannot be used.
    """
    return _make(str(name), tuple(sorted((options or {}).items())), _last_change_ns(str(name)))


def _last_change_ns(name: str) -> int:
    path = Path(name)
    return 0 if name.startswith(HOME_PREFIX) or not path.is_file() else path.stat().st_mtime_ns


@lru_cache(maxsize=NUM_SCENES)
def _make(name: str, options: tuple[tuple[str, Any], ...], _changed_ns: int) -> Scene:
    return make_scene(name, **dict(options))
