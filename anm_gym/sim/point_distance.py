"""Geodesic distance to one fixed point: shortest paths over a raster, pulled tight."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.sim.geodesic import GridGraph
from anm_gym.sim.traversable import TraversableGrid


class DistanceToPoint:
    """Geodesic distance from anywhere on the floor to one fixed point.

    Shortest paths over the grid's eight neighbours are up to 8 % too long. They are pulled tight
    here, from the fixed point on: of the cells from which the last corner is seen in a straight line,
    bisection finds one that the next cell hides it from, which is the next corner. What is found is
    kept, as an agent asks again one step later; a way may be a few centimetres shorter or longer for
    what was asked before.

    Args:
        grid: Where the body fits.
        graph: The graph of its navigable cells.
        point_xz: (2,) the fixed point, metres; it must be navigable.
        limit_m: Places farther away over the grid are as if there were no path, metres.
        ways: What another one found on the same grid to the same point; see `ways`.
    """

    def __init__(
        self,
        grid: TraversableGrid,
        graph: GridGraph,
        point_xz: ArrayLike,
        limit_m: float = np.inf,
        ways: "Ways | None" = None,
    ) -> None:
        self._grid = grid
        self._point_xz = np.array(point_xz, np.float64)
        cell = grid.cell_at(self._point_xz)
        assert cell is not None, "the caller has checked that the point is navigable"
        self._tree = graph.tree_from(cell, limit_m)
        self.grid_distance_m = self._tree.distance_m
        """(rows, columns) distances over the grid, not pulled tight, metres."""
        to_point_m = float(np.linalg.norm(grid.frame.centers_of(cell)[0] - self._point_xz))
        self.ways: Ways = ways or {self._flat(cell): Way(self._point_xz, None, to_point_m)}
        """The ways that were found so far, by the number of the cell from which they lead."""

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

    def _way_from(self, from_xz: ArrayLike) -> "Way | None":
        start_xz = np.array(from_xz, np.float64)
        cell = self._grid.cell_at(start_xz)
        if cell is None or np.isinf(self.grid_distance_m[cell[0], cell[1]]):
            return None
        if self._is_free(start_xz, self._point_xz):
            return Way(self._point_xz, None, length_m(start_xz, self._point_xz))
        flat = self._flat(cell)
        return self._extend(start_xz, self._centers([flat])[0], self._way_of(flat))

    def _way_of(self, flat: int) -> "Way":
        """The way from a cell's centre, by corners among the cells of the path to the nearest known way."""
        path = [flat]
        while path[-1] not in self.ways:
            path.append(int(self._tree.predecessors[path[-1]]))
        centers = self._centers(path)
        known = len(path) - 1
        while known > 0:
            known = self._pull_tight(path, centers, known)
        return self.ways[flat]

    def _pull_tight(self, path: Sequence[int], centers: NDArray[np.float64], known: int) -> int:
        """Find the way of a cell as far back on a path as its corner is seen; returns which.

        The line of sight along the whole path is looked at first, then that along halves.
        """
        way = self.ways[path[known]]
        seen, hidden = known, -1
        while seen - hidden > 1:
            tried = 0 if hidden < 0 else (seen + hidden) // 2
            if self._is_free(centers[tried], way.corner_xz):
                seen = tried
            else:
                hidden = tried
        reached = min(seen, known - 1)
        self.ways[path[reached]] = self._extend(centers[reached], centers[reached + 1], way)
        return reached

    def _extend(self, from_xz: NDArray[np.float64], next_xz: NDArray[np.float64], next_way: "Way") -> "Way":
        """The way from a point through a neighbouring one, with as few corners as can be seen."""
        seen: Way | None = None
        ahead: Way | None = next_way
        while ahead is not None and self._is_free(from_xz, ahead.corner_xz):
            seen, ahead = ahead, ahead.onward
        if seen is None:
            return Way(next_xz, next_way, length_m(from_xz, next_xz) + next_way.length_m)
        rest_m = 0.0 if seen.onward is None else seen.onward.length_m
        return Way(seen.corner_xz, seen.onward, length_m(from_xz, seen.corner_xz) + rest_m)

    def _is_free(self, from_xz: NDArray[np.float64], to_xz: NDArray[np.float64]) -> bool:
        """Tell whether all cells that a straight line meets, looked at every quarter cell, are navigable."""
        frame, way_xz = self._grid.frame, to_xz - from_xz
        shares = _inner_shares(int(4.0 * max(abs(way_xz[0]), abs(way_xz[1])) / frame.cell_m) + 1)
        cells = (((from_xz - frame.origin_xz) + shares * way_xz) / frame.cell_m).astype(np.int32)
        return bool(self._grid.navigable[cells[:, 1], cells[:, 0]].all())

    def _flat(self, cell: NDArray[np.int64]) -> int:
        return int(cell[0]) * self._grid.frame.shape[1] + int(cell[1])

    def _centers(self, cells: Sequence[int]) -> NDArray[np.float64]:
        """(K, 2) centres of cells, metres."""
        frame = self._grid.frame
        return frame.centers_of(np.stack(np.divmod(np.array(cells), frame.shape[1]), axis=1))


@dataclass(frozen=True, eq=False)
class Way:
    """A taut way from some place to the fixed point."""

    corner_xz: NDArray[np.float64]
    """(2,) where it goes straight to, metres."""
    onward: "Way | None"
    """The way from there; None at the fixed point."""
    length_m: float
    """Its whole length, metres."""


Ways = dict[int, Way]


@lru_cache(maxsize=1024)
def _inner_shares(parts: int) -> NDArray[np.float64]:
    """(parts - 1, 1) where a line is cut into equal parts."""
    return (np.arange(1, parts) / parts)[:, None]


def length_m(from_xz: NDArray[np.float64], to_xz: NDArray[np.float64]) -> float:
    """Distance of two floor points, metres."""
    return math.hypot(to_xz[0] - from_xz[0], to_xz[1] - from_xz[1])
