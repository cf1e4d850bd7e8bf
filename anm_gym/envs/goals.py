"""Point goals: how far away they are along the floor, and how they are drawn."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.errors import EpisodeError
from anm_gym.sim.geodesic import GridGraph
from anm_gym.sim.traversable import TraversableGrid

LineTest = Callable[[NDArray[np.float64], NDArray[np.float64]], bool]

STRAIGHT_RATIO = 1.1
"""Paths longer than this many times the straight line are never refused (Habitat)."""
MAX_DRAWS = 100
"""Goals drawn before the most winding of them is taken."""


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
    here: corners are left out wherever the straight line stays navigable.

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

    def __call__(self, from_xz: ArrayLike) -> float:
        """Length of the shortest path from a floor point, metres; infinite if there is none."""
        path = self.path_from(from_xz)
        return float("inf") if path is None else float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())

    def path_from(self, from_xz: ArrayLike) -> NDArray[np.float64] | None:
        """Corners of the shortest path from a floor point, (L, 2) with both ends; None if there is none."""
        start_xz = np.array(from_xz, np.float64)
        cell = self._grid.cell_at(start_xz)
        cells = None if cell is None else self._tree.path_to(cell)
        if cells is None:
            return None
        inner = self._grid.frame.centers_of(cells[::-1])[1:-1]
        return pull_tight(np.vstack([start_xz, inner, self._point_xz]), self._is_free)

    def _is_free(self, from_xz: NDArray[np.float64], to_xz: NDArray[np.float64]) -> bool:
        """Tell whether all cells that a straight line meets, looked at every quarter cell, are navigable."""
        frame = self._grid.frame
        count = int(4.0 * np.abs(to_xz - from_xz).max() / frame.cell_m) + 2
        shares = np.linspace(0.0, 1.0, count)[1:-1, None]
        cells = ((from_xz + shares * (to_xz - from_xz) - frame.origin_xz) / frame.cell_m).astype(np.int64)
        return bool(self._grid.navigable[cells[:, 1], cells[:, 0]].all())


def pull_tight(path_xz: NDArray[np.float64], is_free: LineTest) -> NDArray[np.float64]:
    """Leave out points of a path wherever a straight line will do.

    Args:
        path_xz: (L, 2) points; each is taken to be joined to the next.
        is_free: Tells whether a straight line between two points can be walked.

    Returns:
        (K, 2) points of the path, with both of its ends.
    """
    kept, last = [0], len(path_xz) - 1
    while kept[-1] < last:
        here = kept[-1]
        seen, step = here + 1, 2
        while seen < last and is_free(path_xz[here], path_xz[min(here + step, last)]):
            seen, step = min(here + step, last), 2 * step
        hidden = min(here + step, last)
        while hidden - seen > 1:
            middle = (seen + hidden) // 2
            seen, hidden = (middle, hidden) if is_free(path_xz[here], path_xz[middle]) else (seen, middle)
        kept.append(seen)
    return path_xz[kept]


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
    best_xz, best_ratio = None, 0.0
    for _ in range(MAX_DRAWS if len(cells) else 0):
        goal_xz = grid.frame.centers_of(cells[rng.integers(len(cells))])[0]
        length_m = distance(goal_xz)
        ratio = length_m / float(np.linalg.norm(goal_xz - start_xz))
        if not limits.min_m <= length_m <= limits.max_m:
            continue
        if rng.random() < _acceptance(ratio):
            return np.asarray(goal_xz)
        if ratio > best_ratio:
            best_xz, best_ratio = goal_xz, ratio
    if best_xz is None:
        raise EpisodeError(
            f"a goal must lie {limits.min_m} to {limits.max_m} m from the start, got none around x, z = "
            f"{start_xz.tolist()}; lower `min_distance_m` or choose another start"
        )
    return np.asarray(best_xz)


def _acceptance(ratio: float) -> float:
    """Probability that a goal is taken, by the ratio of geodesic to Euclidean distance (Habitat)."""
    return 1.0 if ratio > STRAIGHT_RATIO else 20.0 * (ratio - 0.98) ** 2
