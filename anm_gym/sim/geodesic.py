"""Shortest paths on a floor raster: eight neighbours, no cutting of corners, metres."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""Half of the eight neighbours; the graph is undirected."""


@dataclass(frozen=True)
class GeodesicTree:
    """Shortest paths from one cell to all."""

    distance_m: NDArray[np.float64]
    """(rows, columns) path lengths (or costs), infinite where unreachable."""
    predecessors: NDArray[np.int32]
    """(rows * columns,) flat index of the cell before, negative at the start and where unreachable."""

    def path_to(self, cell: ArrayLike) -> NDArray[np.int64] | None:
        """Follow the path from the start to a cell, (L, 2) cells with both ends, or None."""
        row, column = (int(value) for value in np.asarray(cell))
        shape = self.distance_m.shape
        if not (0 <= row < shape[0] and 0 <= column < shape[1]) or np.isinf(self.distance_m[row, column]):
            return None
        flat = [row * shape[1] + column]
        while self.predecessors[flat[-1]] >= 0:
            flat.append(int(self.predecessors[flat[-1]]))
        return np.stack(np.divmod(np.array(flat[::-1], np.int64), shape[1]), axis=1)


class GridGraph:
    """The graph of the free cells of a raster.

    A diagonal step needs both cells beside it free.

    Args:
        free: (rows, columns) bool.
        cell_m: Edge of a cell, metres.
        cost: (rows, columns) factor >= 0 on the length of a step, the mean of its two cells; None for 1.
        has_dear_corners: Whether a diagonal step costs as the dearest of the four cells that it touches, so
            that nothing slips between two dear ones that meet at a corner.

    Raises:
        ValueError: If `cost` has another shape.
    """

    def __init__(
        self,
        free: NDArray[np.bool_],
        cell_m: float,
        cost: NDArray[np.floating] | None = None,
        *,
        has_dear_corners: bool = False,
    ) -> None:
        if cost is not None and cost.shape != free.shape:
            raise ValueError(f"`cost` must have shape {free.shape}, got {cost.shape}")
        self.free, self.cell_m, self._has_dear_corners = free, cell_m, has_dear_corners
        rows, columns = free.shape
        index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
        parts = [self._edges(index, step, cost) for step in STEPS]
        first, second, weight = (np.concatenate(values) for values in zip(*parts, strict=True))
        size = rows * columns
        self._graph = csr_array((weight, (first, second)), shape=(size, size))

    def distance_from(self, cells: ArrayLike) -> NDArray[np.float64]:
        """Distance (rows, columns) to the nearest of (K, 2) cells, metres; infinite where unreachable."""
        sources = self._flat(cells)
        if len(sources) == 0:
            return np.full(self.free.shape, np.inf)
        distance = dijkstra(self._graph, directed=False, indices=sources, min_only=True)
        return np.asarray(distance).reshape(self.free.shape)

    def spread(self, beginning_m: NDArray[np.floating]) -> NDArray[np.float64]:
        """Spread a wave that is at some cells already, at different distances.

        Args:
            beginning_m: (rows, columns) metres >= 0 at which it begins; infinite where it does not.

        Returns:
            (rows, columns) shortest distances, metres; infinite where unreachable.
        """
        begins = np.flatnonzero(np.isfinite(beginning_m) & self.free)
        graph, origin = self._graph, self.free.size
        with_origin = csr_array(
            (
                np.concatenate([graph.data, beginning_m.reshape(-1)[begins]]),
                np.concatenate([graph.indices, begins]),
                np.append(graph.indptr, graph.nnz + len(begins)),
            ),
            shape=(origin + 1, origin + 1),
        )
        distance = dijkstra(with_origin, directed=False, indices=origin)
        return np.asarray(distance[:-1]).reshape(self.free.shape)

    def tree_from(self, cell: ArrayLike, limit_m: float = np.inf) -> GeodesicTree:
        """Shortest paths from one free cell; cells farther than the limit are as if unreachable.

        Raises:
            ValueError: If the cell is not free.
        """
        sources = self._flat(cell)
        if len(sources) == 0:
            raise ValueError(f"`cell` must be free, got {np.asarray(cell).tolist()}")
        distance, before = dijkstra(
            self._graph,
            directed=False,
            indices=int(sources[0]),
            return_predecessors=True,
            limit=limit_m,
        )
        return GeodesicTree(np.asarray(distance).reshape(self.free.shape), np.asarray(before))

    def path(self, start_cell: ArrayLike, goal_cell: ArrayLike) -> NDArray[np.int64] | None:
        """Shortest path between two cells, (L, 2) with both ends; None if there is none."""
        if len(self._flat(start_cell)) == 0:
            return None
        return self.tree_from(start_cell).path_to(goal_cell)

    def _flat(self, cells: ArrayLike) -> NDArray[np.int64]:
        """Flat indices of those cells that are inside and free."""
        index = np.atleast_2d(np.asarray(cells, np.int64))
        inside = ((index >= 0) & (index < self.free.shape)).all(axis=1)
        index = index[inside]
        index = index[self.free[index[:, 0], index[:, 1]]]
        return np.asarray(index[:, 0] * self.free.shape[1] + index[:, 1])

    def _edges(
        self, index: NDArray[np.int32], step: tuple[int, int], cost: NDArray[np.floating] | None
    ) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]:
        d_row, d_column = step
        rows, columns = self.free.shape
        left = slice(max(0, -d_column), columns - max(0, d_column))
        right = slice(max(0, d_column), columns - max(0, -d_column))
        upper, lower = slice(0, rows - d_row), slice(d_row, rows)
        both = self.free[upper, left] & self.free[lower, right]
        if d_row and d_column:
            both &= self.free[upper, right] & self.free[lower, left]
        length = self.cell_m * float(np.hypot(d_row, d_column))
        factor = np.ones(self.free.shape) if cost is None else cost
        if self._has_dear_corners and d_row and d_column:
            touched = factor[upper, left], factor[upper, right], factor[lower, left], factor[lower, right]
            factors = np.max(touched, axis=0)
        else:
            factors = 0.5 * (factor[upper, left] + factor[lower, right])
        return index[upper, left][both], index[lower, right][both], length * factors[both]


def nearest_free_cell(free: NDArray[np.bool_], cell: ArrayLike, max_cells: int) -> NDArray[np.int64] | None:
    """Find the free cell nearest to a cell, (2,), within `max_cells`; None if there is none."""
    center = np.asarray(cell, np.int64)
    low = np.maximum(center - max_cells, 0)
    high = np.minimum(center + max_cells + 1, free.shape)
    if (low >= high).any():
        return None
    candidates = np.argwhere(free[low[0] : high[0], low[1] : high[1]]) + low
    if len(candidates) == 0:
        return None
    squared = ((candidates - center) ** 2).sum(axis=1)
    nearest = int(squared.argmin())
    return candidates[nearest] if squared[nearest] <= max_cells**2 else None
