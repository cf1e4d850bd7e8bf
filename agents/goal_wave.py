"""How far the goal is over what is not known to be blocked: a wave that spreads from the goal.

A planning layer in front of the network, as value iteration networks have one inside. Unknown floor
counts as free, so the wave is as wrong as the memory is; what to make of it is learned.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

FAR_M: Final = 1e6


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
    max_rounds: int = 160
    """Rounds in which the wave spreads by one cell."""


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
        self._low = np.zeros((num_agents, 2), np.int64)
        self._goal_xz = np.full((num_agents, 2), np.nan, np.float32)
        self._age = np.arange(num_agents) % settings.every_steps

    def keep(self, agents: Sequence[int]) -> None:
        """Go on with some of the agents only, in the order given."""
        self._distance_m, self._low = self._distance_m[agents], self._low[agents]
        self._goal_xz, self._age = self._goal_xz[agents], self._age[agents]

    def low_cells(self, position_xz: NDArray[np.float32]) -> NDArray[np.int64]:
        """Lower corners (x, z) of windows around (N, 2) places, in cells."""
        cells = np.floor(position_xz / np.float32(self.settings.cell_m)).astype(np.int64)
        return np.asarray(cells - self.settings.window_cells // 2)

    def due(self, goal_xz: NDArray[np.float32]) -> NDArray[np.int64]:
        """Agents whose wave is to be spread now: it is old, or their goal is new.

        Args:
            goal_xz: (N, 2) floor points, metres.
        """
        self._age += 1
        is_new = ~(np.abs(goal_xz - self._goal_xz) < 0.5 * self.settings.cell_m).all(axis=1)
        return np.flatnonzero(is_new | (self._age >= self.settings.every_steps))

    def spread(
        self,
        agents: NDArray[np.int64],
        low: NDArray[np.int64],
        blocked: NDArray[np.bool_],
        goal_xz: NDArray[np.float32],
    ) -> None:
        """Let the waves of some agents spread.

        Args:
            agents: (K,) which.
            low: (K, 2) lower corners of their windows, in cells.
            blocked: (K, cells, cells) what is known to be blocked; rows along z.
            goal_xz: (K, 2) their goals, metres.
        """
        if len(agents) == 0:
            return
        seeds = self._seeds(low, goal_xz)
        self._distance_m[agents] = _relax(seeds, blocked, self.settings)
        self._low[agents], self._goal_xz[agents], self._age[agents] = low, goal_xz, 0

    def at(self, points_xz: NDArray[np.float32]) -> NDArray[np.float32]:
        """Distance to the goal at (N, P, 2) floor points, metres; as the crow flies outside of the window."""
        count = self.settings.window_cells
        cells = np.floor(points_xz / np.float32(self.settings.cell_m)).astype(np.int64) - self._low[:, None]
        inside = ((cells >= 0) & (cells < count)).all(axis=2)
        clipped = np.clip(cells, 0, count - 1)
        agents = np.arange(len(points_xz))[:, None]
        straight = np.linalg.norm(points_xz - self._goal_xz[:, None], axis=2)
        within = self._distance_m[agents, clipped[..., 1], clipped[..., 0]]
        return np.asarray(np.where(inside, within, straight))

    def _seeds(self, low: NDArray[np.int64], goal_xz: NDArray[np.float32]) -> NDArray[np.float32]:
        """Where waves begin: at the goal, and at the rim with the straight distance."""
        count, cell_m = self.settings.window_cells, self.settings.cell_m
        centers = (low[:, None] + np.arange(count)[None, :, None] + 0.5) * cell_m
        along = np.abs(centers - goal_xz[:, None])
        straight = np.hypot(along[:, None, :, 0], along[:, :, None, 1]).astype(np.float32)
        seeds = np.full_like(straight, FAR_M)
        for rim in (np.s_[:, 0], np.s_[:, -1], np.s_[:, :, 0], np.s_[:, :, -1]):
            seeds[rim] = straight[rim]
        is_goal = straight < 0.71 * cell_m
        return np.asarray(np.where(is_goal, straight, seeds))


def _relax(
    seeds: NDArray[np.float32], blocked: NDArray[np.bool_], settings: GoalWaveSettings
) -> NDArray[np.float32]:
    """Spread waves over eight neighbours until nothing changes; corners of blocked cells are not cut."""
    step_m = np.float32(settings.cell_m)
    price = np.where(blocked, np.float32(settings.blocked_cost), np.float32(1.0)) * step_m
    blocked_m = settings.blocked_cost * step_m
    beside = np.pad(blocked, ((0, 0), (1, 1), (1, 1)))
    vertical = {row: beside[:, 1 + row : 1 + row + blocked.shape[1], 1:-1] for row in (-1, 1)}
    sideways = {column: beside[:, 1:-1, 1 + column : 1 + column + blocked.shape[2]] for column in (-1, 1)}
    corner = {
        (row, column): np.where(vertical[row] | sideways[column], blocked_m, 0.0).astype(np.float32)
        for row in (-1, 1)
        for column in (-1, 1)
    }
    padded = np.pad(seeds, ((0, 0), (1, 1), (1, 1)), constant_values=FAR_M)
    inner = padded[:, 1:-1, 1:-1]
    rows, columns = blocked.shape[1:]
    diagonal_price = np.float32(np.sqrt(2.0)) * price
    for _ in range(settings.max_rounds):
        straight = np.minimum(padded[:, :-2, 1:-1], padded[:, 2:, 1:-1])
        np.minimum(straight, padded[:, 1:-1, :-2], out=straight)
        np.minimum(straight, padded[:, 1:-1, 2:], out=straight)
        straight += price
        diagonal = np.full_like(straight, FAR_M)
        for (row, column), penalty in corner.items():
            other = padded[:, 1 + row : 1 + row + rows, 1 + column : 1 + column + columns]
            np.minimum(diagonal, other + penalty, out=diagonal)
        diagonal += diagonal_price
        np.minimum(straight, diagonal, out=straight)
        np.minimum(straight, inner, out=straight)
        if not (straight < inner - 1e-4).any():
            break
        inner[:] = straight
    return inner.copy()
