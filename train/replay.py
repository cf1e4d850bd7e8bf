"""Play a recorded trajectory again and check that every pose comes back bit for bit.

Command: ``python -m train.replay runs/explore/trajectory.npz``.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from jsonargparse import auto_cli

from train.command import run_command
from train.episodes import make_env, scene_of
from train.recorder import EpisodeRecorder
from train.runner import run_episode
from train.scores import make_meter
from train.trajectory import Trajectory

SAME_PCT: Final = 0.001
"""Difference of completion ratios that is rounding, percentage points."""


class RecordedPolicy:
    """Gives the recorded actions, one after the other."""

    def __init__(self, actions: np.ndarray) -> None:
        """Start at the first action."""
        self._actions = iter(actions.tolist())

    def predict(self, observation: Any, state: Any = None, **_others: Any) -> tuple[int, Any]:  # noqa: ARG002
        """Give the next recorded action."""
        return next(self._actions), state


@dataclass(frozen=True)
class Replay:
    """What came out of playing a trajectory again."""

    is_equal: bool
    """Whether every pose has the same bits."""
    largest_difference: float
    """Largest difference of any coordinate, metres or radians."""
    comp_pct: float
    """Completion ratio of the replay, per cent."""


def replay(trajectory: Trajectory) -> Replay:
    """Play the actions of a trajectory in its scene from its start.

    Args:
        trajectory: What to play.

    Returns:
        How the poses compare, and the completion ratio.

    Raises:
        ValueError: If the trajectory has no action, or the scene is no longer what it was.
    """
    if len(trajectory.actions) == 0:
        raise ValueError("`trajectory` must have at least one action, got 0")
    env = make_env(trajectory.scene, len(trajectory.actions), trajectory.env_options)
    if trajectory.scene_hash != scene_of(env).mesh.content_hash:
        raise ValueError(
            f"the geometry of {trajectory.scene} must be the recorded one ({trajectory.scene_hash}), got "
            f"{scene_of(env).mesh.content_hash}; replay with the file and the version that made it"
        )
    recorder = EpisodeRecorder(make_meter(env))
    run_episode(env, RecordedPolicy(trajectory.actions), trajectory.seed, recorder)
    again = recorder.trajectory(trajectory.scene, trajectory.seed, trajectory.env_options)
    env.close()
    is_equal = again.poses.tobytes() == trajectory.poses.tobytes()
    difference = float(np.abs(again.poses - trajectory.poses).max()) if not is_equal else 0.0
    return Replay(is_equal, difference, recorder.meter.comp_pct)


def main(trajectory: Path) -> None:
    """Replay a recorded episode.

    Args:
        trajectory: File that `train.explore` or `train.evaluate` left.

    Raises:
        ValueError: If a pose comes out differently.
    """
    recorded = Trajectory.load(trajectory)
    result = replay(recorded)
    print(f"{len(recorded.actions)} steps in {recorded.scene}, seed {recorded.seed}")
    scored_pct = float(recorded.curves.get("comp_pct", [result.comp_pct])[-1])
    print(f"completion ratio {result.comp_pct:.2f} %, recorded {scored_pct:.2f} %")
    if not result.is_equal:
        raise ValueError(
            f"the replayed poses must equal the recorded ones, differ by {result.largest_difference:.3g}; "
            f"replay with the version that made {trajectory}"
        )
    print("every pose is bit for bit the recorded one")
    if abs(result.comp_pct - scored_pct) > SAME_PCT:
        print("but this version measures otherwise: `measures` or `surface` of its rows will differ too")


if __name__ == "__main__":
    run_command(lambda: auto_cli(main, as_positional=True))
