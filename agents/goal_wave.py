"""How far the goal is over what is not known to be blocked: a wave that spreads from the goal.

A planning layer in front of the network, as value iteration networks have one inside. Unknown floor
counts as free, so the wave is as wrong as the memory is; what to make of it is learned.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from anm_gym.checks import check_at_least, check_positive
from anm_gym.sim.geodesic import GridGraph

DRIFT_SHARE: Final = 10
"""An agent may be this part of its window's width off the middle before the window moves."""
SAME_GOAL_M: Final = 0.01
"""Goals that differ less are the same: they are worked out anew from distance and bearing, metres."""


@dataclass(frozen=True)
class GoalWaveSettings:
    """Sizes of the wave (ours)."""

    cell_m: float = 0.2
    """Edge of a cell, metres: a door is at least two of them wide, whatever its direction."""
    window_cells: int = 48
    """Rows and columns around the agent; at their rim the distance to the goal is as the crow flies."""
    blocked_cost: float = 20.0
    """Price of a metre through blocked cells: finite, so that a goal behind furniture has a distance."""
    every_steps: int = 4
    """Steps between two waves of an agent; agents take turns."""

    def __post_init__(self) -> None:
        check_positive(self, "cell_m", "blocked_cost")
        check_at_least(self, 1, "every_steps")
        check_at_least(self, 2, "window_cells")


@final
class GoalWave:
    """Distances to the goals of N agents, in windows around them.

    Args:
        num_agents: N.
        settings: Sizes.

    Source:
        Ours, after Tamar et al., Value Iteration Networks, 2016, with nothing to learn.
    """

    def __init__(self, num_agents: int, settings: GoalWaveSettings) -> None:
        self.settings = settings
        count = settings.window_cells
        self._distance_m = np.zeros((num_agents, count, count), np.float32)
        self._blocked = np.zeros((num_agents, count, count), bool)
        self._low = np.zeros((num_agents, 2), np.int64)
        self._goal_xz = np.full((num_agents, 2), np.nan, np.float32)
        self._age = np.arange(num_agents) % settings.every_steps

    def forget(self, index: int) -> None:
        """Forget one agent's wave."""
        self._goal_xz[index] = np.nan

    def keep(self, agents: Sequence[int]) -> None:
        """Go on with some of the agents only, in the order given."""
        self._distance_m, self._blocked = self._distance_m[agents], self._blocked[agents]
        self._low, self._goal_xz = self._low[agents], self._goal_xz[agents]
        self._age = self._age[agents]

    def low_cells(self, agents: NDArray[np.int64], position_xz: NDArray[np.float32]) -> NDArray[np.int64]:
        """Lower corners of the windows of agents, which move only when they are far from the middle.

        Args:
            agents: (K,) which.
            position_xz: (K, 2) where they are, metres.

        Returns:
            (K, 2) corners (x, z), in cells.
        """
        cells = np.floor(position_xz / np.float32(self.settings.cell_m)).astype(np.int64)
        centered, kept = cells - self.settings.window_cells // 2, self._low[agents]
        stays = np.abs(centered - kept).max(axis=1) <= self.settings.window_cells // DRIFT_SHARE
        stays &= ~np.isnan(self._goal_xz[agents, 0])
        return np.where(stays[:, None], kept, centered)

    def due(self, goal_xz: NDArray[np.float32]) -> NDArray[np.int64]:
        """Agents whose wave is to be spread now: it is old, or their goal is new.

        Args:
            goal_xz: (N, 2) floor points, metres.
        """
        self._age += 1
        is_new = self._goal_is_off(np.arange(len(goal_xz)), goal_xz, 0.5 * self.settings.cell_m)
        return np.flatnonzero(is_new | (self._age >= self.settings.every_steps))

    def spread(
        self,
        agents: NDArray[np.int64],
        low: NDArray[np.int64],
        blocked: NDArray[np.bool_],
        goal_xz: NDArray[np.float32],
    ) -> None:
        """Let the waves of some agents spread; one that would come out the same is left as it is.

        Args:
            agents: (K,) which.
            low: (K, 2) lower corners of their windows, in cells.
            blocked: (K, cells, cells) what is known to be blocked; rows along z.
            goal_xz: (K, 2) their goals, metres.
        """
        self._age[agents] = 0
        differs = (low != self._low[agents]).any(axis=1) | (blocked != self._blocked[agents]).any(axis=(1, 2))
        differs |= self._goal_is_off(agents, goal_xz, SAME_GOAL_M)
        agents, low, blocked, goal_xz = agents[differs], low[differs], blocked[differs], goal_xz[differs]
        count, cell_m = self.settings.window_cells, np.float32(self.settings.cell_m)
        straight_m = straight_distances(cell_centers(low, count, cell_m), goal_xz)
        seeds_m = wave_seeds(straight_m, straight_m, cell_m)
        price_m = np.where(blocked, cell_m * np.float32(self.settings.blocked_cost), cell_m)
        for agent, seeds, prices in zip(agents, seeds_m, price_m, strict=True):
            self._distance_m[agent] = spread_wave(seeds, prices)
        self._low[agents], self._blocked[agents], self._goal_xz[agents] = low, blocked, goal_xz

    def _goal_is_off(
        self, agents: NDArray[np.int64], goal_xz: NDArray[np.float32], by_m: float
    ) -> NDArray[np.bool_]:
        """(K,) whose goal is not where their wave leads; so for all that have no wave yet."""
        away = np.abs(goal_xz - self._goal_xz[agents])
        return np.asarray(~(away < by_m).all(axis=1))

    def at(
        self, points_xz: NDArray[np.float32], agents: NDArray[np.int64] | None = None
    ) -> NDArray[np.float32]:
        """Distance to the goal at floor points, metres; as the crow flies outside of the window.

        Args:
            points_xz: (K, P, 2) float32 floor points, metres.
            agents: (K,) whose they are; None for those of all N agents.

        Returns:
            (K, P) float32 metres.
        """
        who = np.arange(len(points_xz)) if agents is None else agents
        count = self.settings.window_cells
        cells = np.floor(points_xz / np.float32(self.settings.cell_m)).astype(np.int64) - self._low[who, None]
        inside = ((cells >= 0) & (cells < count)).all(axis=2)
        clipped = np.clip(cells, 0, count - 1)
        straight = np.linalg.norm(points_xz - self._goal_xz[who, None], axis=2)
        within = self._distance_m[who[:, None], clipped[..., 1], clipped[..., 0]]
        return np.asarray(np.where(inside, within, straight))

    def goals_of(self, agents: NDArray[np.int64]) -> NDArray[np.float32]:
        """(K, 2) goals to which the waves of some agents lead, metres."""
        return self._goal_xz[agents]


def cell_centers(low: NDArray[np.int64], count: int, cell_m: np.float32) -> NDArray[np.float32]:
    """Floor points of the cells of windows.

    Args:
        low: (K, 2) lower corners (x, z) of the windows, in cells.
        count: Rows, along z, and columns, along x.
        cell_m: Edge of a cell, metres.

    Returns:
        (K, count, count, 2) float32 metres.
    """
    along = (low[:, None] + np.arange(count)[None, :, None] + 0.5) * cell_m
    x, z = np.broadcast_arrays(along[:, None, :, 0], along[:, :, None, 1])
    return np.stack([x, z], axis=-1).astype(np.float32)


def straight_distances(points_xz: NDArray[np.float32], goal_xz: NDArray[np.float32]) -> NDArray[np.float32]:
    """(K, R, C) float32 straight distances from (K, R, C, 2) points to (K, 2) goals, metres."""
    away = points_xz - goal_xz[:, None, None]
    return np.asarray(np.hypot(away[..., 0], away[..., 1]))


def wave_seeds(
    straight_m: NDArray[np.float32], rim_m: NDArray[np.float32], cell_m: np.float32
) -> NDArray[np.float32]:
    """Where waves begin: at the goal, and at the rim of the window.

    Args:
        straight_m: (K, rows, columns) float32 straight distances to the goals, metres.
        rim_m: (K, rows, columns) float32 distances from the rim on, of which only the rim counts, metres.
        cell_m: Edge of a cell, metres.

    Returns:
        (K, rows, columns) float32 distances at which waves begin, metres; infinite where they do not.
    """
    seeds_m = np.full_like(straight_m, np.inf)
    for rim in (np.s_[:, 0], np.s_[:, -1], np.s_[:, :, 0], np.s_[:, :, -1]):
        seeds_m[rim] = rim_m[rim]
    return np.asarray(np.where(straight_m < 0.71 * cell_m, straight_m, seeds_m))


def spread_wave(seeds_m: NDArray[np.float32], price_m: NDArray[np.float32]) -> NDArray[np.float32]:
    """Spread a wave over cells of different prices; it does not slip between dear ones that meet at a corner.

    Args:
        seeds_m: (rows, columns) float32 distances at which it begins, metres; infinite where it does not.
        price_m: (rows, columns) float32 price of crossing a cell, metres.

    Returns:
        (rows, columns) float32 distances, metres.
    """
    graph = GridGraph(np.ones(price_m.shape, bool), 1.0, price_m, has_dear_corners=True)
    return graph.spread(seeds_m).astype(np.float32)
