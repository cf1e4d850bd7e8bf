"""Point goals: how far away they are along the floor, and how they are drawn."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.errors import EpisodeError
from anm_gym.sim.geodesic import GridGraph
from anm_gym.sim.traversable import TraversableGrid

STRAIGHT_RATIO = 1.1
"""Paths longer than this many times the straight line are never refused (Habitat)."""
MAX_DRAWS = 100
"""Goals drawn before the most winding of them is taken."""
MAX_STARTS = 10
"""Starts drawn for an episode before its scene is given up (Habitat's generator)."""


@dataclass(frozen=True)
class GoalRange:
    """How far a goal may lie from the start.

    Source:
        Habitat's generator of point-goal episodes.
    """

    min_m: float = 1.0
    """Shortest geodesic distance, metres."""
    max_m: float = 30.0
    """Longest geodesic distance, metres."""

    def __post_init__(self) -> None:
        if not 0.0 < self.min_m < self.max_m:
            raise ValueError(
                "`min_distance_m` must be > 0 and less than `max_distance_m`, "
                f"got {self.min_m} and {self.max_m}"
            )


class DistanceToPoint:
    """Geodesic distance from anywhere on the floor to one fixed point.

    Shortest paths over the grid's eight neighbours are up to 8 % too long. They are pulled tight
    here: each cell on a path takes over the corner that the cell after it goes to, wherever the
    straight line to it stays navigable. What is found of a path is kept, as an agent asks again one
    step later.

    Args:
        grid: Where the body fits.
        graph: The graph of its navigable cells.
        point_xz: (2,) the fixed point, metres; it must be navigable.
    """

    def __init__(self, grid: TraversableGrid, graph: GridGraph, point_xz: ArrayLike) -> None:
        self._grid = grid
        self._point_xz = np.array(point_xz, np.float64)
        cell = grid.cell_at(self._point_xz)
        assert cell is not None, "the caller has checked that the point is navigable"
        self._tree = graph.tree_from(cell)
        self.grid_distance_m = self._tree.distance_m
        """(rows, columns) distances over the grid, not pulled tight, metres."""
        to_point_m = float(np.linalg.norm(grid.frame.centers_of(cell)[0] - self._point_xz))
        self._ways = {self._flat(cell): _Way(self._point_xz, None, to_point_m)}

    def __call__(self, from_xz: ArrayLike) -> float:
        """Length of the shortest path from a floor point, metres; infinite if there is none."""
        way = self._way_from(from_xz)
        return float("inf") if way is None else way.length_m

    def path_from(self, from_xz: ArrayLike) -> NDArray[np.float64] | None:
        """Corners of the shortest path from a floor point, (L, 2) with both ends; None if there is none."""
        way = self._way_from(from_xz)
        corners = [np.array(from_xz, np.float64)]
        if way is None:
            return None
        while way is not None:
            corners.append(way.corner_xz)
            way = way.onward
        return np.stack(corners)

    def _way_from(self, from_xz: ArrayLike) -> "_Way | None":
        start_xz = np.array(from_xz, np.float64)
        cell = self._grid.cell_at(start_xz)
        if cell is None or np.isinf(self.grid_distance_m[cell[0], cell[1]]):
            return None
        if self._is_free(start_xz, self._point_xz):
            return _Way(self._point_xz, None, _length_m(start_xz, self._point_xz))
        flat = self._flat(cell)
        return self._extend(start_xz, self._center(flat), self._way_of(flat))

    def _way_of(self, flat: int) -> "_Way":
        """The way from a cell's centre; those of the cells after it are found first."""
        pending = []
        while flat not in self._ways:
            pending.append(flat)
            flat = int(self._tree.predecessors[flat])
        for cell in reversed(pending):
            self._ways[cell] = self._extend(self._center(cell), self._center(flat), self._ways[flat])
            flat = cell
        return self._ways[flat]

    def _extend(self, from_xz: NDArray[np.float64], next_xz: NDArray[np.float64], next_way: "_Way") -> "_Way":
        """The way from a point through a neighbouring one, with as few corners as can be seen."""
        seen: _Way | None = None
        ahead: _Way | None = next_way
        while ahead is not None and self._is_free(from_xz, ahead.corner_xz):
            seen, ahead = ahead, ahead.onward
        if seen is None:
            return _Way(next_xz, next_way, _length_m(from_xz, next_xz) + next_way.length_m)
        rest_m = 0.0 if seen.onward is None else seen.onward.length_m
        return _Way(seen.corner_xz, seen.onward, _length_m(from_xz, seen.corner_xz) + rest_m)

    def _is_free(self, from_xz: NDArray[np.float64], to_xz: NDArray[np.float64]) -> bool:
        """Tell whether all cells that a straight line meets, looked at every quarter cell, are navigable."""
        frame, way_xz = self._grid.frame, to_xz - from_xz
        shares = _inner_shares(int(4.0 * max(abs(way_xz[0]), abs(way_xz[1])) / frame.cell_m) + 1)
        cells = (((from_xz - frame.origin_xz) + shares * way_xz) / frame.cell_m).astype(np.int32)
        return bool(self._grid.navigable[cells[:, 1], cells[:, 0]].all())

    def _flat(self, cell: NDArray[np.int64]) -> int:
        return int(cell[0]) * self._grid.frame.shape[1] + int(cell[1])

    def _center(self, flat: int) -> NDArray[np.float64]:
        frame = self._grid.frame
        row, column = divmod(flat, frame.shape[1])
        return np.array([column + 0.5, row + 0.5]) * frame.cell_m + frame.origin_xz


@dataclass(frozen=True, eq=False)
class _Way:
    """A taut way from some place to the fixed point."""

    corner_xz: NDArray[np.float64]
    """(2,) where it goes straight to, metres."""
    onward: "_Way | None"
    """The way from there; None at the fixed point."""
    length_m: float
    """Its whole length, metres."""


@lru_cache(maxsize=1024)
def _inner_shares(parts: int) -> NDArray[np.float64]:
    """(parts - 1, 1) where a line is cut into equal parts."""
    return (np.arange(1, parts) / parts)[:, None]


def _length_m(from_xz: NDArray[np.float64], to_xz: NDArray[np.float64]) -> float:
    return math.hypot(to_xz[0] - from_xz[0], to_xz[1] - from_xz[1])


def draw_goal(
    grid: TraversableGrid,
    graph: GridGraph,
    start_xz: NDArray[np.float64],
    limits: GoalRange,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Draw a goal that can be reached from the start and is not merely straight ahead.

    Cells at an allowed distance are drawn uniformly; one is refused more often, the closer the
    length of its path comes to the straight line.

    Args:
        grid: Where the body fits.
        graph: The graph of its navigable cells.
        start_xz: (2,) where the episode begins, metres.
        limits: Allowed geodesic distance.
        rng: Where it is drawn.

    Returns:
        (2,) centre of a navigable cell, metres.

    Raises:
        EpisodeError: If no place is at an allowed distance.

    Source:
        Habitat's generator, with its rule for the ratio of geodesic to Euclidean distance. It draws
        for ever; we take the most winding of 100 draws, as an empty room has straight paths only.
    """
    distance = DistanceToPoint(grid, graph, start_xz)
    over_grid_m = distance.grid_distance_m
    cells = np.argwhere((over_grid_m >= limits.min_m) & (over_grid_m <= limits.max_m))
    refused = []
    for _ in range(MAX_DRAWS if len(cells) else 0):
        cell = cells[rng.integers(len(cells))]
        goal_xz = grid.frame.centers_of(cell)[0]
        straight_m = _length_m(start_xz, goal_xz)
        longest_m = over_grid_m[cell[0], cell[1]] + grid.frame.cell_m
        share = rng.random()
        if share >= _acceptance(longest_m / straight_m):
            refused.append(goal_xz)
            continue
        length_m = distance(goal_xz)
        if limits.min_m <= length_m <= limits.max_m and share < _acceptance(length_m / straight_m):
            return np.asarray(goal_xz)
        refused.append(goal_xz)
    if (most_winding_xz := _most_winding(refused, distance, start_xz, limits)) is None:
        raise EpisodeError(
            f"a goal must lie {limits.min_m} to {limits.max_m} m from the start, got none around x, z = "
            f"{start_xz.tolist()}; lower `min_distance_m` or choose another start"
        )
    return most_winding_xz


def _most_winding(
    goals: list[NDArray[np.float64]],
    distance: DistanceToPoint,
    start_xz: NDArray[np.float64],
    limits: GoalRange,
) -> NDArray[np.float64] | None:
    """The goal at an allowed distance whose path is longest for its straight line; None if there is none."""
    lengths_m = [distance(goal_xz) for goal_xz in goals]
    ratios = [
        length_m / _length_m(start_xz, goal_xz) if limits.min_m <= length_m <= limits.max_m else 0.0
        for goal_xz, length_m in zip(goals, lengths_m, strict=True)
    ]
    return np.asarray(goals[int(np.argmax(ratios))]) if any(ratios) else None


def _acceptance(ratio: float) -> float:
    """Probability that a goal is taken, by the ratio of geodesic to Euclidean distance (Habitat)."""
    return 1.0 if ratio > STRAIGHT_RATIO else 20.0 * (ratio - 0.98) ** 2
