"""Planners of grid baselines: A*, the distances of fast marching, and RRT*.

Exact costs over a whole raster are `anm_gym.sim.geodesic`'s; the planners here are what published
baselines use on their maps, where unknown cells may count as free. The suite's own agents grow trees; the
other two are for whoever rebuilds a baseline.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from math import sqrt
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.checks import check_at_least, check_choices, check_positive
from anm_gym.sim.geodesic import STEPS, GridGraph

Cell = tuple[int, int]
"""Row and column."""
CONVERGED_CELLS: Final = 1e-3
"""`marching_distance` ends when no cell changes by more than this, cells."""
ROUNDS_PER_CELL: Final = 2
"""It ends after as many rounds as this for every row and column, if not before."""
SAMPLES_PER_CELL: Final = 2
"""Points at which a straight line is tested, per cell of its length."""


def astar_path(
    free: NDArray[np.bool_], start_cell: ArrayLike, goal_cell: ArrayLike
) -> NDArray[np.int64] | None:
    """Find a shortest path between two cells by A*, looking towards the goal first.

    A diagonal step needs both cells beside it free, as in `GridGraph`, whose paths are as long.

    Args:
        free: (rows, columns) cells to walk on.
        start_cell: (2,) row and column.
        goal_cell: (2,) row and column.

    Returns:
        (L, 2) cells with both ends; None if there is no path.

    Source:
        Hart, Nilsson and Raphael, A formal basis for the heuristic determination of minimum cost paths,
        1968; what is left to go is estimated as in a raster without obstacles.

    Example:
        >>> free = np.ones((3, 3), bool)
        >>> free[1, :2] = False
        >>> astar_path(free, (0, 0), (2, 0)).tolist()
        [[0, 0], [0, 1], [0, 2], [1, 2], [2, 2], [2, 1], [2, 0]]
    """
    start, goal = (tuple(np.asarray(cell, np.int64).tolist()) for cell in (start_cell, goal_cell))
    if not (_is_free(free, *start) and _is_free(free, *goal)):
        return None
    costs, before = {start: 0.0}, dict[Cell, Cell]()
    queue = [(_octile(start, goal), start, start)]
    while queue:
        _, cell, previous = heappop(queue)
        if cell in before:
            continue
        before[cell] = previous
        if cell == goal:
            return _way_back(before, goal)
        for following, length in _steps_from(free, cell):
            cost = costs[cell] + length
            if cost < costs.get(following, np.inf):
                costs[following] = cost
                heappush(queue, (cost + _octile(following, goal), following, cell))
    return None


def _is_free(free: NDArray[np.bool_], row: int, column: int) -> bool:
    """Whether a cell is inside and free."""
    return 0 <= row < free.shape[0] and 0 <= column < free.shape[1] and bool(free[row, column])


def _octile(first: Cell, second: Cell) -> float:
    """Length of the shortest path over eight neighbours if all cells are free, cells."""
    shorter, longer = sorted((abs(first[0] - second[0]), abs(first[1] - second[1])))
    return longer + (sqrt(2.0) - 1.0) * shorter


def _steps_from(free: NDArray[np.bool_], cell: Cell) -> Iterator[tuple[Cell, float]]:
    """The cells to which a step leads, and its length in cells; corners are not cut."""
    row, column = cell
    for d_row, d_column in (*STEPS, *((-row, -column) for row, column in STEPS)):
        touched = (row + d_row, column), (row, column + d_column), (row + d_row, column + d_column)
        if all(_is_free(free, *place) for place in touched):
            yield touched[-1], float(np.hypot(d_row, d_column))


def _way_back(before: dict[Cell, Cell], goal: Cell) -> NDArray[np.int64]:
    """Follow the cells before the goal to the one that is its own."""
    way = [goal]
    while before[way[-1]] != way[-1]:
        way.append(before[way[-1]])
    return np.array(way[::-1], np.int64)


def marching_distance(
    free: NDArray[np.bool_], cell_m: float, goal_cells: ArrayLike, max_rounds: int | None = None
) -> NDArray[np.float64]:
    """Distance to the nearest goal along any angle, as fast marching gives it.

    Distances over eight neighbours, up to 8 % too long, are lowered by the upwind update of the eikonal
    equation until they no longer change; farther than five cells from a goal, 4 % too long at most remain.

    Args:
        free: (rows, columns) cells to walk on.
        cell_m: Edge of a cell, metres.
        goal_cells: (K, 2) rows and columns.
        max_rounds: Updates of all cells, at most; None for as many as corrections need to cross the raster.

    Returns:
        (rows, columns) float64 metres; infinite where there is no way.

    Source:
        Sethian, A fast marching level set method, 1996; the start from a graph is ours.
    """
    graph = GridGraph(free, 1.0).distance_from(goal_cells)
    reachable = np.isfinite(graph)
    far = 4.0 * free.size
    distance = np.pad(np.where(reachable, graph, far), 1, constant_values=far)
    inner = distance[1:-1, 1:-1]
    for _ in range(ROUNDS_PER_CELL * sum(free.shape) if max_rounds is None else max_rounds):
        lower = np.minimum(inner, _upwind(distance))
        change = np.max(inner - lower, where=reachable, initial=0.0)
        inner[:] = np.where(reachable, lower, far)
        if change < CONVERGED_CELLS:
            break
    return np.where(reachable, cell_m * inner, np.inf)


def _upwind(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve |gradient| = 1 in each inner cell of a padded raster for its lower neighbours, cells."""
    along_rows = np.minimum(distance[:-2, 1:-1], distance[2:, 1:-1])
    along_columns = np.minimum(distance[1:-1, :-2], distance[1:-1, 2:])
    gap = along_rows - along_columns
    both = 0.5 * (along_rows + along_columns + np.sqrt(np.maximum(2.0 - gap**2, 0.0)))
    return np.where(np.abs(gap) < 1.0, both, np.minimum(along_rows, along_columns) + 1.0)


@dataclass(frozen=True)
class RrtSettings:
    """How a tree of paths is grown."""

    iterations: int = 2500
    """Points that are drawn."""
    extension_m: float = 0.25
    """Longest edge of a new point, metres; rewired, it may be as long as `neighbour_m`."""
    neighbour_m: float = 0.25
    """Largest distance of a neighbour that may become a parent, metres."""
    shrink_m: float = 1.0
    """Neighbours are within `shrink_m` * sqrt(ln n / n) of n nodes as well, metres."""
    sampling: Literal["whole_map", "window"] = "window"
    """Draw from the whole raster, or from a square around the start that the paths cannot leave anyway."""
    window_m: float = 3.0
    """Half the edge of that square, metres."""

    def __post_init__(self) -> None:
        check_choices(self)
        check_at_least(self, 1, "iterations")
        check_positive(self, "extension_m", "neighbour_m", "shrink_m", "window_m")


@dataclass(frozen=True, eq=False)
class PathTree:
    """Paths from one start, as a tree; places in cells, (row, column), centres at +0.5."""

    nodes: NDArray[np.float64]
    """(N, 2) places, the start first."""
    parents: NDArray[np.int64]
    """(N,) the node before; the start is its own."""

    @property
    def depths(self) -> NDArray[np.int64]:
        """(N,) edges between the start and each node."""
        depths = np.zeros(len(self.nodes), np.int64)
        ancestors = np.arange(len(self.nodes))
        while ancestors.any():
            depths += ancestors != 0
            ancestors = self.parents[ancestors]
        return depths

    def path_to(self, node: int) -> NDArray[np.float64]:
        """Places from the start to a node, (L, 2), both ends included."""
        chain = [node]
        while chain[-1] != 0:
            chain.append(int(self.parents[chain[-1]]))
        return self.nodes[chain[::-1]]


def grow_tree(
    blocked: NDArray[np.bool_],
    cell_m: float,
    start: ArrayLike,
    settings: RrtSettings,
    rng: np.random.Generator,
) -> PathTree:
    """Grow an RRT* without a goal: every node hangs from the neighbour with the shortest way.

    Args:
        blocked: (rows, columns) cells that paths must not touch; the start's own does not count.
        cell_m: Edge of a cell, metres.
        start: (2,) row and column of the start, in cells with fractions.
        settings: How to grow.
        rng: Draws the points.

    Source:
        Karaman and Frazzoli, Sampling-based algorithms for optimal motion planning, 2011.
    """
    origin = np.asarray(start, np.float64)
    blocked = blocked.copy()
    blocked[int(origin[0]), int(origin[1])] = False
    tree = _Growth(blocked, origin, settings, cell_m)
    low, high = np.zeros(2), np.asarray(blocked.shape, np.float64)
    if settings.sampling == "window":
        reach = settings.window_m / cell_m
        low, high = np.maximum(low, origin - reach), np.minimum(high, origin + reach)
    for point in rng.uniform(low, np.maximum(high, low), (settings.iterations, 2)):
        tree.extend(point)
    return PathTree(tree.nodes[: tree.count].copy(), tree.parents[: tree.count].copy())


def line_is_free(
    blocked: NDArray[np.bool_], starts: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Tell which straight lines from (K, 2) places to one place (2,), in cells, touch no blocked cell."""
    longest = float(np.abs(end - starts).max(initial=0.0))
    shares = np.linspace(0.0, 1.0, int(np.ceil(SAMPLES_PER_CELL * longest)) + 2)[1:]
    places = starts[:, None] + shares[:, None] * (end - starts)[:, None]
    cells = places.astype(np.int64)
    np.clip(cells, 0, np.asarray(blocked.shape) - 1, out=cells)
    return np.asarray(~blocked[cells[..., 0], cells[..., 1]].any(axis=1))


class _Growth:
    """The tree while it grows; its arrays have room for all nodes."""

    def __init__(
        self, blocked: NDArray[np.bool_], start: NDArray[np.float64], settings: RrtSettings, cell_m: float
    ) -> None:
        self._blocked = blocked
        self._extension = settings.extension_m / cell_m
        self._neighbour, self._shrink = settings.neighbour_m / cell_m, settings.shrink_m / cell_m
        size = settings.iterations + 1
        self.nodes, self.parents = np.zeros((size, 2)), np.zeros(size, np.int64)
        self._costs = np.zeros(size)
        self.nodes[0], self.count = start, 1

    def extend(self, point: NDArray[np.float64]) -> None:
        """Grow towards a point, and let it shorten the ways of its neighbours."""
        delta = self.nodes[: self.count] - point
        nearest = int(np.einsum("nd,nd->n", delta, delta).argmin())
        length = float(np.hypot(*delta[nearest]))
        if length == 0.0:
            return
        share = min(1.0, self._extension / length)
        place = self.nodes[nearest] - share * delta[nearest]
        if not line_is_free(self._blocked, self.nodes[nearest : nearest + 1], place)[0]:
            return
        near, gaps = self._neighbours(place, nearest)
        self._hang(place, near, gaps)

    def _neighbours(
        self, place: NDArray[np.float64], nearest: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Nodes that can see a place and are near to it, and their distances in cells."""
        radius = min(self._neighbour, self._shrink * np.sqrt(np.log(self.count) / self.count))
        delta = self.nodes[: self.count] - place
        squared = np.einsum("nd,nd->n", delta, delta)
        near = np.flatnonzero(squared <= radius**2)
        near = np.append(near[near != nearest], nearest)
        is_free = line_is_free(self._blocked, self.nodes[near], place)
        is_free[-1] = True  # tested by itself; beside longer lines it is sampled elsewhere
        near = near[is_free]
        return near, np.sqrt(squared[near])

    def _hang(self, place: NDArray[np.float64], near: NDArray[np.int64], gaps: NDArray[np.float64]) -> None:
        node = self.count
        costs = self._costs[near] + gaps
        best = int(costs.argmin())
        self.nodes[node], self.parents[node], self._costs[node] = place, near[best], costs[best]
        self.count += 1
        shorter = costs[best] + gaps < self._costs[near] - 1e-9
        for other, cost in zip(near[shorter], (costs[best] + gaps)[shorter], strict=True):
            self._shift(int(other), float(cost - self._costs[other]))
            self.parents[other] = node

    def _shift(self, node: int, change: float) -> None:
        """Change the cost of a node and of all that hang from it."""
        below = np.array([node])
        while len(below):
            self._costs[below] += change
            below = np.flatnonzero(np.isin(self.parents[: self.count], below))
            below = below[below != 0]
