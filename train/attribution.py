"""Where the steps of an episode went: stuck, towards what cannot be reached, in circles, for nothing.

Computed from the trajectory, the goals and the CPU time alone, so that it can be computed again from the
files of an episode. The definitions are in ``docs/evaluation.md``; `train.attribution_report` shows them.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from anm_gym.actions import Action
from anm_gym.checks import check_at_least
from anm_gym.geometry import wrap_angles
from train.results import Row
from train.trajectory import Trajectory

CAUSES: Final = {
    "stuck_pct": "stuck",
    "unreachable_pct": "unreachable goals",
    "oscillation_pct": "oscillation",
    "phantom_pct": "phantom surface",
}
"""The failures by their key in rows."""
MIN_CAUSE_PCT: Final = 10.0
"""A failure that took a smaller share of the steps is not called the main one, per cent."""
NO_CAUSE: Final = "none"
UNPROMISING: Final = frozenset({"wander", "turn round", "sweep", "look round", "random vertex", "on the way"})
"""Reasons of goals that promise no surface, and so cannot break the promise."""


@dataclass(frozen=True)
class AttributionSettings:
    """What counts as which failure (ours)."""

    stuck_steps: int = 20
    """Length of the stretch in which an agent that is stuck does not get away."""
    stuck_m: float = 0.15
    """Farthest that it gets from where the stretch began, metres."""
    stuck_contacts: int = 3
    """Fewest steps of the stretch that end in contact."""
    loop_steps: int = 100
    """Longest loop of an oscillation."""
    loop_end_m: float = 0.25
    """Distance at which an agent is back where it was, metres."""
    loop_away_m: float = 0.5
    """How far it has been away meanwhile, metres."""
    loop_end_rad: float = np.deg2rad(15.0)
    """Difference of headings at which an agent that turned in place looks where it had looked, radians."""
    loop_away_rad: float = np.deg2rad(45.0)
    """How far it has turned away meanwhile, radians."""
    no_gain_m2: float = 0.5
    """Newly completed surface that counts as nothing new, square metres."""
    last_gain_pct: float = 0.5
    """Completion ratio that may still come after the last progress, percentage points."""
    arrival_slack_m: float = 0.1
    """Added to the distance at which the agent counts a goal as reached, metres."""

    def __post_init__(self) -> None:
        check_at_least(self, 1, "stuck_steps", "stuck_contacts", "loop_steps")
        check_at_least(
            self, 0.0, "stuck_m", "loop_end_m", "loop_away_m", "loop_end_rad", "loop_away_rad", "no_gain_m2"
        )
        check_at_least(self, 0.0, "last_gain_pct", "arrival_slack_m")


@dataclass(frozen=True, eq=False)
class GoalFates:
    """How each goal ended."""

    lengths: NDArray[np.int64]
    """(G,) steps during which it was the current goal."""
    is_failed: NDArray[np.bool_]
    """(G,) given up."""
    is_reached: NDArray[np.bool_]
    """(G,) reached; what is neither was dropped for another, or was the last."""
    is_fruitless: NDArray[np.bool_]
    """(G,) reached, had promised surface, and nothing new was seen on the way or there."""


@dataclass(frozen=True, eq=False)
class Attribution:
    """What became of an episode's steps."""

    is_stuck: NDArray[np.bool_]
    """(T,) whether the agent was stuck at each step."""
    is_oscillating: NDArray[np.bool_]
    """(T,) whether the step was part of a loop that showed nothing new."""
    rotation_pct: float
    """Share of turns among the steps, per cent."""
    no_gain_pct: float
    """Share of the steps after the last progress, per cent."""
    fates: GoalFates | None
    """The goals; None for an agent that has none."""
    failure_reasons: dict[str, int]
    """Goals given up by reason."""

    @property
    def shares_pct(self) -> dict[str, float | None]:
        """Share of the steps by cause, per cent; None where the agent has no goals."""
        steps = max(len(self.is_stuck), 1)
        fates = self.fates
        on_goals = {
            "unreachable_pct": None if fates is None else int(fates.lengths[fates.is_failed].sum()),
            "phantom_pct": None if fates is None else int(fates.lengths[fates.is_fruitless].sum()),
        }
        counts: dict[str, int | None] = {
            "stuck_pct": int(self.is_stuck.sum()),
            "oscillation_pct": int(self.is_oscillating.sum()),
            **on_goals,
        }
        return {key: None if counts[key] is None else 100.0 * (counts[key] or 0) / steps for key in CAUSES}

    @property
    def main_cause(self) -> str:
        """The failure that took most steps; `none` if none took a tenth of them."""
        shares = {key: share or 0.0 for key, share in self.shares_pct.items()}
        largest = max(shares, key=lambda key: shares[key])
        return CAUSES[largest] if shares[largest] >= MIN_CAUSE_PCT else NO_CAUSE

    def as_row(self) -> Row:
        """Give the plain values that a row keeps."""
        fates = self.fates
        counts = {
            "goals": None if fates is None else len(fates.lengths),
            "goals_reached": None if fates is None else int(fates.is_reached.sum()),
            "goals_failed": None if fates is None else int(fates.is_failed.sum()),
        }
        shares = {key: None if share is None else round(share, 2) for key, share in self.shares_pct.items()}
        return {
            "main_cause": self.main_cause,
            **shares,
            "rotation_pct": round(self.rotation_pct, 2),
            "no_gain_pct": round(self.no_gain_pct, 2),
            **counts,
            "failure_reasons": self.failure_reasons,
        }


def attribute(
    trajectory: Trajectory, arrival_m: float | None, settings: AttributionSettings | None = None
) -> Attribution:
    """Say where the steps of an episode went.

    Args:
        trajectory: The episode, with its goals and its curves of completion and collisions.
        arrival_m: Distance at which the agent counts a goal as reached, metres; None if it has no goals.
        settings: What counts as which failure.

    Returns:
        The attribution.

    Source:
        Ours, after the failures that Active Neural Mapping names in Sec. 6.1 and its supplement.
    """
    chosen = settings or AttributionSettings()
    actions, completion = trajectory.actions, trajectory.curves["comp_pct"]
    is_turn = (actions == Action.TURN_LEFT) | (actions == Action.TURN_RIGHT)
    steps = max(len(actions), 1)
    late = completion[1:] >= completion[-1] - chosen.last_gain_pct
    return Attribution(
        is_stuck=stuck_steps(trajectory, chosen),
        is_oscillating=oscillating_steps(trajectory, chosen),
        rotation_pct=100.0 * int(is_turn.sum()) / steps,
        no_gain_pct=100.0 * int(late.sum()) / steps,
        fates=None if arrival_m is None else goal_fates(trajectory, arrival_m, chosen),
        failure_reasons=dict(Counter(trajectory.failure_reasons)),
    )


def module_shares_pct(cpu_ms: Mapping[str, float]) -> dict[str, float]:
    """Say how an episode's CPU time was spent: share of each module in the `total`, per cent."""
    total_ms = cpu_ms.get("total", 0.0) or 1.0
    return {name: 100.0 * ms / total_ms for name, ms in cpu_ms.items() if name != "total"}


def stuck_steps(trajectory: Trajectory, settings: AttributionSettings) -> NDArray[np.bool_]:
    """(T,) whether each step lies in a stretch with contacts from which the agent does not get away."""
    steps, width = len(trajectory.actions), settings.stuck_steps
    result = np.zeros(steps, bool)
    if steps < width:
        return result
    contacts = np.diff(trajectory.curves["collisions"]) > 0
    windows = sliding_window_view(trajectory.poses[:, :2], width + 1, axis=0)
    reach_m = np.linalg.norm(windows - windows[..., :1], axis=1).max(axis=1)
    touches = sliding_window_view(contacts, width).sum(axis=1)
    begins = np.flatnonzero((reach_m <= settings.stuck_m) & (touches >= settings.stuck_contacts))
    return _covered(begins, begins + width, steps)


def oscillating_steps(trajectory: Trajectory, settings: AttributionSettings) -> NDArray[np.bool_]:
    """(T,) whether each step is part of a loop, away and back or turned and turned back, for nothing new."""
    poses, seen_m2 = trajectory.poses, trajectory.completed_m2
    steps = len(trajectory.actions)
    away_m, away_rad = np.zeros((2, len(poses)))
    result = np.zeros(steps, bool)
    for length in range(1, min(settings.loop_steps, steps) + 1):
        change = poses[length:] - poses[:-length]
        distance_m = np.hypot(change[:, 0], change[:, 1])
        turned_rad = np.abs(wrap_angles(change[:, 2]))
        away_m = np.maximum(away_m[: len(change)], distance_m)
        away_rad = np.maximum(away_rad[: len(change)], turned_rad)
        has_turned = (turned_rad <= settings.loop_end_rad) & (away_rad >= settings.loop_away_rad)
        is_back = (distance_m <= settings.loop_end_m) & ((away_m >= settings.loop_away_m) | has_turned)
        begins = np.flatnonzero(is_back & (seen_m2[length:] - seen_m2[:-length] < settings.no_gain_m2))
        result |= _covered(begins, begins + length, steps)
    return result


def goal_fates(trajectory: Trajectory, arrival_m: float, settings: AttributionSettings) -> GoalFates:
    """Say how each goal of an episode ended."""
    goals, seen_m2 = trajectory.goals, trajectory.completed_m2
    begins = goals[:, 2].astype(np.int64)
    ends = np.append(begins[1:], len(trajectory.actions))
    is_failed = _failed_goals(np.column_stack([goals[:, :2], ends]), trajectory.failures)
    left_m = np.linalg.norm(trajectory.poses[ends, :2] - goals[:, :2], axis=1)
    is_reached = ~is_failed & (left_m <= arrival_m + settings.arrival_slack_m)
    reasons = [*trajectory.goal_reasons, *[""] * (len(goals) - len(trajectory.goal_reasons))]
    promises = np.array([reason not in UNPROMISING for reason in reasons], bool)
    is_fruitless = is_reached & promises & (seen_m2[ends] - seen_m2[begins] < settings.no_gain_m2)
    return GoalFates(ends - begins, is_failed, is_reached, is_fruitless)


def _failed_goals(ended: NDArray[np.float64], failures: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(G,) which goals failed, by (x, z, step) of each end and each failure.

    Of goals that ended at one place in one step, the last one is the one that failed.
    """
    candidates: dict[tuple[float, ...], list[int]] = defaultdict(list)
    for index, end in enumerate(ended.tolist()):
        candidates[tuple(end)].append(index)
    is_failed = np.zeros(len(ended), bool)
    for failure in failures.tolist():
        if candidates[tuple(failure)]:
            is_failed[candidates[tuple(failure)].pop()] = True
    return is_failed


def _covered(begins: NDArray[np.intp], ends: NDArray[np.intp], length: int) -> NDArray[np.bool_]:
    """(length,) whether each place lies in one of the half-open intervals."""
    change = np.zeros(length + 1, np.int64)
    np.add.at(change, begins, 1)
    np.add.at(change, ends, -1)
    return np.asarray(change[:-1].cumsum() > 0)
