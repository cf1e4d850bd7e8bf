"""How an agent walks in the 2-D twin: the actions and step lengths of the simulator, without a mesh."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.graph import MCP_Geometric

from anm_gym.actions import FORWARD_STEP_M, TURN_STEP_DEG
from anm_gym.checks import check_at_least, check_positive
from anm_gym.geometry import forward_xz, heading_towards, wrap_angle
from anm_gym.sim.geodesic import nearest_free_cell
from anm_gym.sim.grid_planning import line_is_free
from train.occant.twin_world import TwinWorld

CONTACT_M: Final = 0.15
"""How far ahead of the body's centre an obstacle is taken to be when a step is blocked, metres."""
FACING_SHARE: Final = 0.9
"""The agent walks if the way lies within this share of a turn, and turns otherwise (paper's code)."""


@dataclass(frozen=True)
class WalkSettings:
    """How ways are planned and followed."""

    corner_m: float = 0.1
    """Distance at which a corner of the way counts as passed, metres."""
    arrival_m: float = 0.3
    """Distance at which a goal is reached, metres; the agent turns on the spot from then on."""
    unknown_cost: float = 4.0
    """Factor on the length of a way through unknown cells, as the suite's planner has it."""
    margin_m: float = 3.0
    """Ways are searched in the box of agent and goal and this margin, metres (paper's code)."""
    escape_m: float = 0.25
    """Around the agent clearance is waived, metres."""
    max_plans: int = 3
    """Ways planned for one goal."""
    forward_step_m: float = FORWARD_STEP_M
    """Length of a forward step, metres."""
    turn_step_rad: float = float(np.deg2rad(TURN_STEP_DEG))
    """Angle of a turn, radians."""

    def __post_init__(self) -> None:
        check_positive(self, "corner_m", "arrival_m", "forward_step_m", "turn_step_rad")
        check_at_least(self, 0.0, "unknown_cost", "margin_m", "escape_m")
        check_at_least(self, 1, "max_plans")


class TwinWalker:
    """A body in a world of heights.

    Args:
        world: Where it walks.
        pose: (3,) x, z in metres and heading in radians of the start, world frame.
        settings: How it follows ways.
    """

    def __init__(self, world: TwinWorld, pose: NDArray[np.float64], settings: WalkSettings) -> None:
        self.world, self.settings = world, settings
        self.pose = np.array(pose, np.float64)
        """(3,) x, z in metres and heading in radians, world frame."""
        self.touched = np.zeros(world.frame.shape, bool)
        """(rows, columns): cells in which a step was blocked."""

    def walk(
        self, goal_xz: NDArray[np.float64], is_seen: NDArray[np.bool_], steps: int
    ) -> NDArray[np.float64]:
        """Spend some actions on the way to a goal.

        Args:
            goal_xz: (2,) floor point, metres, world frame.
            is_seen: (rows, columns) cells of the world that the agent has seen; others may be free.
            steps: Number of actions.

        Returns:
            (steps, 3) poses after each action.
        """
        poses, plans = np.empty((steps, 3)), 1
        way = self._plan(goal_xz, is_seen)
        for step in range(steps):
            while len(way) > 1 and np.hypot(*(way[0] - self.pose[:2])) <= self.settings.corner_m:
                way = way[1:]
            is_blocked = self._act(way)
            if is_blocked and plans < self.settings.max_plans:
                way, plans = self._plan(goal_xz, is_seen), plans + 1
            elif is_blocked:
                way = way[:0]
            poses[step] = self.pose
        return poses

    def _act(self, way: NDArray[np.float64]) -> bool:
        """Take one action along a way, (L, 2) corners ahead; tell whether it was blocked."""
        settings, position_xz = self.settings, self.pose[:2]
        if len(way) == 0 or np.hypot(*(way[-1] - position_xz)) <= settings.arrival_m:
            self.pose[2] = wrap_angle(self.pose[2] + settings.turn_step_rad)
            return False
        error_rad = wrap_angle(heading_towards(position_xz, way[0]) - self.pose[2])
        if abs(error_rad) > FACING_SHARE * settings.turn_step_rad:
            turn_rad = settings.turn_step_rad if error_rad > 0.0 else -settings.turn_step_rad
            self.pose[2] = wrap_angle(self.pose[2] + turn_rad)
            return False
        forward = forward_xz(self.pose[2])
        target_xz = position_xz + settings.forward_step_m * forward
        if not self.world.is_navigable(target_xz):
            self._touch(position_xz + CONTACT_M * forward)
            return True
        self.pose[:2] = target_xz
        return False

    def _touch(self, point_xz: NDArray[np.float64]) -> None:
        cell = self.world.frame.cells_of(point_xz)
        if self.world.frame.contains(cell)[0]:
            self.touched[cell[0, 0], cell[0, 1]] = True

    def _plan(self, goal_xz: NDArray[np.float64], is_seen: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(L, 2) corners of the cheapest way to the goal, or to the nearest place that can be reached."""
        frame = self.world.frame
        ends = np.clip(frame.cells_of(np.stack([self.pose[:2], goal_xz])), 0, np.subtract(frame.shape, 1))
        margin = round(self.settings.margin_m / frame.cell_m)
        low = np.maximum(ends.min(axis=0) - margin, 0)
        high = np.minimum(ends.max(axis=0) + margin + 1, frame.shape)
        window = np.s_[low[0] : high[0], low[1] : high[1]]
        start, goal = ends - low
        costs = self._costs(window, start, is_seen[window])
        cells = _corners(_cheapest_way(costs, start, goal), np.isinf(costs))
        return frame.centers_of(cells + low)

    def _costs(
        self, window: tuple[slice, slice], start: NDArray[np.int64], is_seen: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Price of each cell of a window; infinite where the body does not fit as far as is known."""
        occupied = (self.world.top_m[window] > 0.0) & is_seen | self.touched[window]
        rows, columns = np.ogrid[: occupied.shape[0], : occupied.shape[1]]
        reach = self.settings.escape_m / self.world.frame.cell_m
        is_far = (rows - start[0]) ** 2 + (columns - start[1]) ** 2 > reach**2
        blocked = np.where(is_far, ndimage.binary_dilation(occupied), occupied)
        costs = np.where(is_seen, 1.0, self.settings.unknown_cost)
        costs[blocked] = np.inf
        costs[start[0], start[1]] = 1.0
        return costs


def _cheapest_way(
    costs: NDArray[np.float64], start: NDArray[np.int64], goal: NDArray[np.int64]
) -> NDArray[np.int64]:
    """(L, 2) cells from the start to the goal, or to the reachable cell nearest to it."""
    reach = 2 * max(costs.shape)
    search = MCP_Geometric(costs)
    end = nearest_free_cell(np.isfinite(costs), goal, reach)
    assert end is not None  # the start is free
    reached, _ = search.find_costs([start], [end], find_all_ends=False)
    if not np.isfinite(reached[end[0], end[1]]):
        end = nearest_free_cell(np.isfinite(reached), goal, reach)
        assert end is not None
    return np.array(search.traceback(end), np.int64)


def _corners(cells: NDArray[np.int64], blocked: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Leave the cells of a way out that straight lines can skip; its start is left out, its end stays."""
    centers, kept, last = cells.astype(np.float64) + 0.5, [], 0
    while last < len(cells) - 1:
        is_free = line_is_free(blocked, centers[last + 1 :], centers[last])
        last += max(1, len(is_free) if is_free.all() else int(is_free.argmin()))
        kept.append(cells[last])
    return np.array(kept, np.int64).reshape(-1, 2) if kept else cells[-1:]
