"""Point goals: how far away they are along the floor, and how they are drawn."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anm_gym.errors import EpisodeError
from anm_gym.sim.geodesic import GridGraph
from anm_gym.sim.point_distance import DistanceToPoint, length_m
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
        if not 0.0 < self.min_m < self.max_m < np.inf:
            raise ValueError(
                "`min_distance_m` must be > 0 and less than `max_distance_m`, which must be finite, "
                f"got {self.min_m} and {self.max_m}"
            )


def draw_ends(
    starts: Iterable[NDArray[np.float64]],
    grid: TraversableGrid,
    graph: GridGraph,
    limits: GoalRange,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Take the first start that has a goal, and draw it.

    Args:
        starts: (2,) where the episode may begin, metres, at least one; the next is asked for only once
            the one before has no goal.
        grid: Where the body fits.
        graph: The graph of its navigable cells.
        limits: Allowed geodesic distance.
        rng: Where the goal is drawn.

    Returns:
        (2,) start and (2,) goal, metres.

    Raises:
        EpisodeError: If no start has a goal; the message is about the last.
    """
    failure: EpisodeError | None = None
    for start_xz in starts:
        try:
            return start_xz, draw_goal(grid, graph, start_xz, limits, rng)
        except EpisodeError as error:
            failure = error
    assert failure is not None, "the caller gives at least one start"
    raise failure


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
    distance = DistanceToPoint(grid, graph, start_xz, limits.max_m)
    over_grid_m = distance.grid_distance_m
    cells = np.argwhere((over_grid_m >= limits.min_m) & (over_grid_m <= limits.max_m))
    refused = []
    for _ in range(MAX_DRAWS if len(cells) else 0):
        cell = cells[rng.integers(len(cells))]
        goal_xz = grid.frame.centers_of(cell)[0]
        straight_m = length_m(start_xz, goal_xz)
        longest_m = over_grid_m[cell[0], cell[1]] + grid.frame.cell_m
        share = rng.random()
        if share >= _acceptance(longest_m / straight_m):
            refused.append(goal_xz)
            continue
        way_m = distance(goal_xz)
        if limits.min_m <= way_m <= limits.max_m and share < _acceptance(way_m / straight_m):
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
    ways_m = [distance(goal_xz) for goal_xz in goals]
    ratios = [
        way_m / length_m(start_xz, goal_xz) if limits.min_m <= way_m <= limits.max_m else 0.0
        for goal_xz, way_m in zip(goals, ways_m, strict=True)
    ]
    return np.asarray(goals[int(np.argmax(ratios))]) if any(ratios) else None


def _acceptance(ratio: float) -> float:
    """Probability that a goal is taken, by the ratio of geodesic to Euclidean distance (Habitat)."""
    return 1.0 if ratio > STRAIGHT_RATIO else 20.0 * (ratio - 0.98) ** 2
