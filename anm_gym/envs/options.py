"""What an environment is told: settings when it is made, options when an episode begins."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from anm_gym.actions import FORWARD_STEP_M, TURN_STEP_DEG

DEFAULT_SCENE: Final = "home:flat:0"
"""The scene of an environment that is made without one: a generated flat."""


@dataclass(frozen=True)
class MeshEnvSettings:
    """Settings that all environments share; plain values, so that an ``EnvSpec`` survives JSON."""

    scene: str = DEFAULT_SCENE
    """Path of a mesh or floor plan, ``home:<tier>:<seed>``, or a dataset's scene such as ``gibson:Denmark``;
    see `anm_gym.scenes.catalog.make_scene`."""
    scene_options: Mapping[str, Any] | None = None
    """Keywords of `anm_gym.scenes.load.load_scene` for a mesh file: `up_axis`, `unit`, `storey`; for a
    dataset's scene also `root`, the folder of datasets. Homes and floor plans are made without."""
    camera: Mapping[str, Any] | None = None
    """Fields of `anm_gym.geometry.CameraSpec` that differ from the paper's camera."""
    forward_step_m: float = FORWARD_STEP_M
    """Length of a forward step, metres."""
    turn_step_deg: float = TURN_STEP_DEG
    """Angle of a turn, degrees."""
    start: Sequence[float] | None = None
    """(x, z, heading_rad) of every episode, metres and radians; None draws it."""
    noise: Mapping[str, float] | None = None
    """Fields of `anm_gym.envs.noise.NoiseSpec` that differ from none."""
    backend: str = "embree"
    """What casts the rays: `embree` or `warp`."""
    device: str = "cpu"
    """Where a `warp` camera runs, such as `cuda:0`."""
    rgb: bool = False
    """Whether to observe colour too."""
    render_mode: str | None = None
    """What `render` returns: `rgb_array`, `depth_array`, or nothing."""


@dataclass(frozen=True, eq=False)
class EpisodeOptions:
    """What ``reset(options=...)`` asks of one episode."""

    scene: str | None = None
    """Scene of this episode; None for the one of the settings."""
    start: NDArray[np.float64] | None = None
    """(3,) x, z in metres and heading in radians; None draws it."""
    goal: NDArray[np.float64] | None = None
    """(2,) x, z in metres; None draws it."""

    @classmethod
    def read(cls, options: Mapping[str, Any] | None, known: Sequence[str]) -> "EpisodeOptions":
        """Check the options of an episode.

        Args:
            options: What `reset` was given.
            known: The names that this environment takes.

        Raises:
            ValueError: If a name is unknown, or a start or goal is not made of finite numbers.
        """
        given = dict(options or {})
        for name in given:
            if name not in known:
                raise ValueError(f"unknown reset option {name!r}{_hint(name, known)}")
        return cls(
            given.get("scene"),
            read_numbers("start", given.get("start"), ("x", "z", "heading_rad")),
            read_numbers("goal", given.get("goal"), ("x", "z")),
        )


def read_numbers(name: str, values: Any, parts: tuple[str, ...]) -> NDArray[np.float64] | None:
    """Read a start or a goal; None stays None.

    Raises:
        ValueError: If there are not as many finite numbers as parts.
    """
    if values is None:
        return None
    try:
        numbers = np.array(values, np.float64)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape != (len(parts),) or not np.isfinite(numbers).all():
        raise ValueError(f"`{name}` must be finite numbers ({', '.join(parts)}), got {values!r}")
    return numbers


def read_names(name: str, values: Iterable[str]) -> list[str]:
    """Read a list of names.

    Raises:
        TypeError: If it is a single text, which would fall apart into letters.
    """
    if isinstance(values, str):
        raise TypeError(f"`{name}` must be a list of names, got {values!r}; write [{values!r}]")
    return list(values)


def _hint(name: str, known: Sequence[str]) -> str:
    close = get_close_matches(name, known, n=1)
    return f"; did you mean {close[0]!r}?" if close else f"; choose among: {', '.join(known)}"
