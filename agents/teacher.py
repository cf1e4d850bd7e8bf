"""The teacher of learned navigators: it knows the floor and goes down the geodesic distance."""

from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from anm_gym.actions import Action
from anm_gym.sim.geodesic import GridGraph
from anm_gym.sim.traversable import CONTACT_M, TraversableGrid

COMFORT_M: Final = 0.3
"""Clearance below which floor costs more, metres; for wide bodies `MARGIN_M` more than their radius."""
MARGIN_M: Final = 0.1
"""What is left beside a wide body where floor costs no more, metres."""
TIGHTNESS: Final = 2.0
"""Added to the price of a metre where the body just fits."""
LOOK_AHEAD_M: Final = 1.0
"""Length of the straight walks that are compared, metres."""
SAMPLE_M: Final = 0.05
"""At most this far apart are the points of a walk, metres."""
TURN_COST_M: Final = 0.02
"""What a turn costs, metres; the choice must not change while the agent turns towards it."""
PROGRESS: Final = 0.5
"""A walk must reduce the cost-to-go by this share of its length, or the agent would walk on rather than
turn round."""
WALK_M: Final = 0.25
"""Shorter walks are compared only where no longer one goes down, metres: over a short one a turn would
never seem worth its cost."""
RIM_CELLS: Final = 2
"""Cells beside the navigable ones that get a cost too, for interpolation."""


@final
class GeodesicTeacher:
    """Choose the action of an agent that descends the geodesic distance to its goal.

    Every heading that turns can reach is tried with straight walks; what remains is the cost-to-go at
    their end. The headings stay the same while the agent turns, and the turns still to make only get
    fewer for the one chosen, so left never follows right on the spot.

    Args:
        grid: Where the body fits.
        goal_xz: (2,) the goal, metres; it must be navigable.
        forward_step_m: Length of a forward step, metres.
        turn_step_rad: Angle of a turn, radians.
        success_m: Distance within which a stop succeeds, metres.

    Source:
        Ours. Wijmans et al. (DD-PPO) learn without a teacher; imitation first is what makes a small
        budget enough.
    """

    def __init__(
        self,
        grid: TraversableGrid,
        goal_xz: ArrayLike,
        forward_step_m: float,
        turn_step_rad: float,
        success_m: float = 0.2,
    ) -> None:
        self._grid, self._goal_xz = grid, np.asarray(goal_xz, np.float64)
        cell = grid.cell_at(self._goal_xz)
        assert cell is not None, "goals are drawn on navigable floor"
        cost = GridGraph(grid.navigable, grid.frame.cell_m, _price(grid.clearance_m, grid.body.radius_m))
        self._cost_m = _with_rim(cost.distance_from(cell))
        self._stop_m = min(0.95 * success_m, max(0.6 * success_m, 0.6 * forward_step_m))
        half = round(np.pi / turn_step_rad)
        self._turns = np.arange(-half + 1, half + 1)
        self._turn_step_rad = turn_step_rad
        per_step = int(np.ceil(forward_step_m / SAMPLE_M))
        count = per_step * max(2, round(LOOK_AHEAD_M / forward_step_m))
        self._per_step, self._sample_m = per_step, forward_step_m / per_step
        self._along_m = self._sample_m * np.arange(1, count + 1)

    def __call__(self, position_xz: NDArray[np.float64], heading_rad: float) -> Action:
        """Choose an action.

        Args:
            position_xz: (2,) where the agent stands, metres.
            heading_rad: Where it looks, radians.
        """
        if np.linalg.norm(self._goal_xz - position_xz) < self._stop_m:
            return Action.STOP
        turns = int(self._turns[int(self._costs(position_xz, heading_rad).argmin())])
        if turns == 0:
            return Action.MOVE_FORWARD
        return Action.TURN_LEFT if turns > 0 else Action.TURN_RIGHT

    def _costs(self, position_xz: NDArray[np.float64], heading_rad: float) -> NDArray[np.float64]:
        """(turns,) cost of turning so far and then walking straight as long as it is good, metres."""
        headings = heading_rad + self._turn_step_rad * self._turns
        directions = np.stack([-np.sin(headings), -np.cos(headings)], axis=1)
        points = position_xz + self._along_m[:, None] * directions[:, None]
        scaled = ((points - self._grid.frame.origin_xz) / self._grid.frame.cell_m - 0.5).reshape(-1, 2)
        places = [scaled[:, 1], scaled[:, 0]]
        shape = points.shape[:2]
        clearance = _interpolate(self._grid.clearance_m, places, 0.0).reshape(shape)
        remaining = _interpolate(self._cost_m, places, np.inf).reshape(shape)
        radius_m = self._grid.body.radius_m
        price = np.where(clearance > radius_m + CONTACT_M, _price(clearance, radius_m), np.inf)
        total = self._sample_m * np.cumsum(price, axis=1) + remaining
        step_ends = slice(self._per_step - 1, None, self._per_step)
        is_nearer = remaining < self._cost_at(position_xz) - PROGRESS * self._along_m
        is_walk = self._along_m >= min(WALK_M, float(np.linalg.norm(self._goal_xz - position_xz)))
        candidates = (
            np.where(is_nearer & is_walk, total, np.inf)[:, step_ends],
            np.where(is_nearer, total, np.inf)[:, step_ends],
            total[:, step_ends],
        )
        best = next((some for some in candidates if np.isfinite(some).any()), total)
        return np.asarray(best.min(axis=1) + TURN_COST_M * np.abs(self._turns))

    def _cost_at(self, position_xz: NDArray[np.float64]) -> float:
        x, z = (position_xz - self._grid.frame.origin_xz) / self._grid.frame.cell_m - 0.5
        return float(_interpolate(self._cost_m, [np.array([z]), np.array([x])], np.inf)[0])


def _interpolate(
    values: NDArray[np.floating], places: list[NDArray[np.float64]], outside: float
) -> NDArray[np.float64]:
    return np.asarray(ndimage.map_coordinates(values, places, order=1, mode="constant", cval=outside))


def _price(clearance_m: NDArray[np.floating], radius_m: float) -> NDArray[np.float64]:
    """Price of a metre by its clearance."""
    comfort_m = max(COMFORT_M, radius_m + MARGIN_M)
    lack = np.clip((comfort_m - clearance_m) / (comfort_m - radius_m), 0.0, 1.0)
    return np.asarray(1.0 + TIGHTNESS * lack**2, np.float64)


def _with_rim(cost_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Continue the cost into the cells beside navigable ones, and cap the rest: infinities do not mix."""
    filled = cost_m
    for _ in range(RIM_CELLS):
        filled = np.where(np.isinf(filled), ndimage.minimum_filter(filled, size=3) + 0.1, filled)
    return np.where(np.isinf(filled), 1e6, filled)
