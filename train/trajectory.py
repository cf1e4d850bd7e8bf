"""An episode on the disk: what is needed to replay it bit for bit, and the curves drawn from it."""

import json
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from anm_gym.metrics.curves import path_length_m
from anm_gym.whole_file import whole_file


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Where an agent was and what it did.

    Raises:
        ValueError: If there is not exactly one pose more than there are actions.
    """

    scene: str
    """Scene as given to the environment: a path or a procedural name."""
    seed: int
    """Seed of the reset."""
    actions: NDArray[np.int8]
    """(T,) actions, Habitat's numbers."""
    poses: NDArray[np.float64]
    """(T + 1, 3) x, z (metres) and heading (radians) before the first and after each action."""
    env_options: dict[str, Any] = field(default_factory=dict)
    """Arguments of the environment besides the scene."""
    goals: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    """(G, 3) x, z (metres) of each goal and the step at which it was set."""
    curves: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    """Named (T + 1,) curves, one value before the first and after each action."""
    scene_hash: str = ""
    """Hash of the scene's geometry; a replay in another geometry is refused."""
    goal_reasons: Sequence[str] = ()
    """Why each goal was proposed; empty in files of earlier versions."""
    failures: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    """(F, 3) x, z (metres) of each goal that was given up and the step at which it was."""
    failure_reasons: Sequence[str] = ()
    """Why each of them was given up."""
    surface_m2: float = np.nan
    """Area of which `comp_pct` is a share, square metres; NaN in files of earlier versions."""

    def __post_init__(self) -> None:
        if len(self.poses) != len(self.actions) + 1:
            raise ValueError(
                f"`poses` must be one more than the {len(self.actions)} actions, got {len(self.poses)}"
            )

    @property
    def path_m(self) -> NDArray[np.float64]:
        """(T + 1,) metres travelled so far."""
        return path_length_m(self.poses[:, :2])

    @property
    def completed_m2(self) -> NDArray[np.float64]:
        """(T + 1,) square metres of surface completed so far; NaN where the area is not known."""
        return self.curves["comp_pct"] / 100.0 * self.surface_m2

    def save(self, path: Path) -> None:
        """Write an .npz of plain arrays; the file appears whole or not at all."""
        names = (
            "scene",
            "seed",
            "env_options",
            "scene_hash",
            "surface_m2",
            "goal_reasons",
            "failure_reasons",
        )
        header = {name: getattr(self, name) for name in names}
        curves: dict[str, Any] = {f"curve_{name}": values for name, values in self.curves.items()}
        with whole_file(path) as draft, draft.open("wb") as file:
            np.savez_compressed(
                file,
                header=np.array(json.dumps(header)),
                actions=self.actions,
                poses=self.poses,
                goals=self.goals,
                failures=self.failures,
                **curves,
            )

    @classmethod
    def load(cls, path: Path) -> "Trajectory":
        """Read what `save` wrote; nothing in the file is executed.

        Raises:
            ValueError: If the file is not a saved trajectory.
        """
        try:
            with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            curves = {
                name.removeprefix("curve_"): arrays[name] for name in arrays if name.startswith("curve_")
            }
            return cls(
                **json.loads(str(arrays.pop("header"))),
                actions=arrays["actions"],
                poses=arrays["poses"],
                goals=arrays["goals"],
                curves=curves,
                failures=arrays.get("failures", np.zeros((0, 3))),
            )
        except (KeyError, TypeError, ValueError, EOFError, BadZipFile, zlib.error) as error:
            raise ValueError(f"{path} must be a trajectory.npz of `train.explore`, got {error!r}") from error
