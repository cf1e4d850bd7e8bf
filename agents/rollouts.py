"""Rollouts: choose a move by trying every heading that turns can reach and walking straight from there.

Turns of 10 degrees cost a step each, as a walk of 6.5 cm does, so a path over the raster is not the
quickest way. Each rollout turns first, then walks; what remains is the cost-to-go at its end.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agents.cost_to_go import CostSettings, CostToGo, Floor
from anm_gym.actions import STRAIGHT_TURNS, Action
from anm_gym.checks import check_at_least, check_positive
from anm_gym.geometry import wrap_angle, wrap_angles


@dataclass(frozen=True)
class RolloutSettings:
    """How far rollouts look ahead (ours)."""

    forward_step_m: float
    """Length of a forward step, metres."""
    turn_step_rad: float
    """Angle of a turn, radians."""
    max_steps: int = 24
    """Forward steps of the longest rollout."""
    loyalty_steps: float = 2.0
    """Steps by which turning back right after a turn must be better: no flicker."""
    bend_slack: float = 1.0
    """Turns at the end of a rollout that are not charged: the descent over the raster is that coarse."""
    bend_steps: float = 5.0
    """Nearer to the goal than this many steps the turns at the end count in proportion."""
    samples_per_step: int = 3
    """Points per forward step at which clearance is looked up."""

    def __post_init__(self) -> None:
        check_positive(self, "forward_step_m", "turn_step_rad")
        check_at_least(self, 1, "max_steps", "samples_per_step")
        check_at_least(self, 0.0, "loyalty_steps", "bend_slack", "bend_steps")


@dataclass(frozen=True)
class Move:
    """The first action of the best rollout."""

    action: Action
    """What to do now."""
    remaining_steps: float
    """Expected steps to the goal."""


def best_move(
    floor: Floor,
    costs: CostToGo,
    position_xz: NDArray[np.float64],
    heading_rad: float,
    settings: RolloutSettings,
    cost_settings: CostSettings,
    last: Action | None = None,
    blocked_rad: Sequence[float] = (),
) -> Move | None:
    """Find the rollout that reaches the goal in the fewest expected steps.

    Args:
        floor: The latest knowledge of the floor.
        costs: Cost-to-go; it may be some steps old.
        position_xz: (2,) where the agent stands, metres.
        heading_rad: Where it looks, radians.
        settings: Sizes of the moves, and how far to look.
        cost_settings: What the floor costs.
        last: The action before this one.
        blocked_rad: Headings in which the agent could not move from here, radians.

    Returns:
        The move, or None if no rollout gets anywhere.
    """
    half_turn = int(np.ceil(np.pi / settings.turn_step_rad))
    turns = np.arange(-half_turn + 1, half_turn + 1)
    headings = np.asarray(heading_rad + turns * settings.turn_step_rad, np.float64)
    points = _rollout_points(position_xz, headings, settings)
    price = _prices(floor, points, position_xz, cost_settings)[:, :, None]
    price = price.reshape(len(turns), settings.max_steps, settings.samples_per_step)
    walked = np.cumsum(price.mean(axis=2), axis=1)
    ends = points[:, settings.samples_per_step - 1 :: settings.samples_per_step]
    togo = costs.at(ends.reshape(-1, 2)).reshape(walked.shape) / settings.forward_step_m
    bends = _final_turns(costs, ends, headings, settings) * np.clip(togo / settings.bend_steps, 0.0, 1.0)
    total = np.abs(turns)[:, None] + walked + togo + bends
    total += settings.loyalty_steps * _turns_back(turns, last)[:, None]
    for blocked in blocked_rad:
        total[_is_same(headings, blocked, settings)] = np.inf
    best = int(total.argmin()) // settings.max_steps
    if not total[best].min() < 1e5:
        return None
    return Move(_first_action(int(turns[best])), float(total[best].min()))


def turn_towards(error_rad: float) -> Action:
    """The turn that reduces a heading error (wanted minus actual), radians."""
    return Action.TURN_LEFT if wrap_angle(error_rad) >= 0.0 else Action.TURN_RIGHT


def _final_turns(
    costs: CostToGo,
    ends: NDArray[np.float64],
    headings: NDArray[np.float64],
    settings: RolloutSettings,
) -> NDArray[np.float64]:
    """(headings, steps) turns needed at the end of each rollout to go down the cost-to-go."""
    onward = costs.heading_at(ends.reshape(-1, 2)).reshape(ends.shape[:2])
    apart = np.abs(wrap_angles(onward - headings[:, None]))
    return np.asarray(np.maximum(apart / settings.turn_step_rad - settings.bend_slack, 0.0))


def _first_action(turns: int) -> Action:
    return Action.MOVE_FORWARD if turns == 0 else turn_towards(float(np.sign(turns)))


def _turns_back(turns: NDArray[np.int_], last: Action | None) -> NDArray[np.bool_]:
    """Mark rollouts that begin by undoing the last turn."""
    undone = {Action.TURN_LEFT: -1, Action.TURN_RIGHT: 1}.get(last, 0) if last is not None else 0
    return np.asarray(turns * undone > 0)


def _is_same(
    headings: NDArray[np.float64], heading_rad: float, settings: RolloutSettings
) -> NDArray[np.bool_]:
    """Mark the headings nearest to one of them."""
    apart = np.abs(wrap_angles(headings - heading_rad))
    return np.asarray(apart < STRAIGHT_TURNS * settings.turn_step_rad)


def _rollout_points(
    position_xz: NDArray[np.float64], headings: NDArray[np.float64], settings: RolloutSettings
) -> NDArray[np.float64]:
    """(headings, samples, 2) floor points of straight walks."""
    count = settings.max_steps * settings.samples_per_step
    ahead_m = np.arange(1, count + 1) * (settings.forward_step_m / settings.samples_per_step)
    directions = np.stack([-np.sin(headings), -np.cos(headings)], axis=1)
    return np.asarray(position_xz + ahead_m[None, :, None] * directions[:, None, :])


def _prices(
    floor: Floor, points: NDArray[np.float64], position_xz: NDArray[np.float64], settings: CostSettings
) -> NDArray[np.float64]:
    """(headings, samples) price of the floor under each point; infinite where the body does not fit."""
    cells = floor.frame.cells_of(points.reshape(-1, 2))
    inside = floor.frame.contains(cells)
    row, column = np.where(inside[:, None], cells, 0).T
    fits = inside & floor.passable(position_xz, settings)[row, column]
    return np.where(fits, floor.price(settings)[row, column], np.inf).reshape(points.shape[:2])
