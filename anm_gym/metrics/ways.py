"""Ways of the oracle: what it costs to drive from a pose to another, and what is covered meanwhile."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from anm_gym.actions import FORWARD_STEP_M, TURN_STEP_DEG
from anm_gym.geometry import wrap_angles
from anm_gym.metrics.pooling import pooled
from anm_gym.metrics.view_table import ViewTable
from anm_gym.sim.geodesic import GeodesicTree, GridGraph, nearest_free_cell
from anm_gym.sim.grid import GridFrame
from anm_gym.sim.traversable import TraversableGrid

_TREE_MEMORY_BYTES: Final = 300_000_000
_BYTES_PER_CELL: Final = 12
_MAX_CELLS: Final = 200_000
"""Ways over a larger floor are planned on cells of twice the width: a tour takes thousands of them."""
_START_M: Final = 0.5
"""How far from a navigable cell a place may be, metres."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where the agent is, or would be, with the shortest paths from there."""

    position_xz: NDArray[np.float64]
    """(2,) floor point, metres."""
    heading_rad: float
    """Heading, radians."""
    tree: GeodesicTree
    """Shortest paths over the true floor."""


@dataclass(frozen=True, eq=False)
class Way:
    """A way to a pose of the view table."""

    pose: tuple[int, int]
    """Position and heading index in the view table."""
    cost_steps: float
    """Steps and turns."""
    bits: NDArray[np.uint64]
    """(W,) uint64 packed samples that are covered on the way, while turning at its end, and there."""


class WayPlanner:
    """Plan ways on the true traversable floor between poses of a view table."""

    def __init__(
        self,
        table: ViewTable,
        grid: TraversableGrid,
        *,
        waypoint_m: float = 0.4,
        forward_step_m: float = FORWARD_STEP_M,
        turn_step_rad: float = float(np.deg2rad(TURN_STEP_DEG)),
    ) -> None:
        """Build the graph.

        Args:
            table: The poses and what they cover.
            grid: The true traversable grid.
            waypoint_m: Spacing at which what is seen on the way is counted, metres.
            forward_step_m: Length of a forward step, metres.
            turn_step_rad: Angle of a turn, radians.
        """
        self._table = table
        self._frame, navigable = _widened(grid)
        self._stride = max(1, round(waypoint_m / self._frame.cell_m))
        self._forward_step_m, self._turn_step_rad = forward_step_m, turn_step_rad
        self._graph = GridGraph(navigable, self._frame.cell_m)
        self._cells = self._frame.cells_of(table.positions_xz)
        self._nearest = cKDTree(table.positions_xz)
        self._trees: dict[int, GeodesicTree] = {}

    def place(self, position_xz: NDArray[np.float64], heading_rad: float) -> Place | None:
        """Stand at a floor point; None if no navigable cell is near."""
        cell = self._frame.cells_of(position_xz)[0]
        start = nearest_free_cell(self._graph.free, cell, round(_START_M / self._frame.cell_m))
        return None if start is None else Place(position_xz, heading_rad, self._graph.tree_from(start))

    def place_at(self, pose: tuple[int, int]) -> Place:
        """Stand at a pose of the table; its paths are kept for the next time."""
        row, column = pose
        if row not in self._trees:
            if len(self._trees) * self._graph.free.size * _BYTES_PER_CELL > _TREE_MEMORY_BYTES:
                self._trees.clear()
            self._trees[row] = self._graph.tree_from(self._cells[row])
        heading_rad = float(self._table.headings_rad[column])
        return Place(self._table.positions_xz[row], heading_rad, self._trees[row])

    def positions_within(self, position_xz: NDArray[np.float64], radius_m: float) -> list[int]:
        """Find the positions of the table within a straight distance."""
        return list(self._nearest.query_ball_point(position_xz, radius_m))

    def direct_costs(self, place: Place) -> NDArray[np.float64]:
        """Steps to each pose (P, K), with the turns of a straight way; infinite where unreachable."""
        distance_m = place.tree.distance_m[self._cells[:, 0], self._cells[:, 1]]
        delta = self._table.positions_xz - place.position_xz
        is_here = distance_m < self._forward_step_m
        bearing = np.where(is_here, place.heading_rad, np.arctan2(-delta[:, 0], -delta[:, 1]))
        turns = np.abs(wrap_angles(bearing - place.heading_rad))[:, None]
        turns = turns + np.abs(wrap_angles(self._table.headings_rad - bearing[:, None]))
        return np.asarray(distance_m[:, None] / self._forward_step_m + turns / self._turn_step_rad)

    def way(self, place: Place, pose: tuple[int, int], bits: NDArray[np.uint64]) -> Way:
        """Plan the way to a reachable pose.

        Args:
            place: Where it starts.
            pose: Position and heading index.
            bits: (P, K, W) uint64, the table's bits or a part of their words.
        """
        row, column = pose
        goal_heading = float(self._table.headings_rad[column])
        points = self._waypoints(place, row)
        legs = np.diff(points, axis=0)
        lengths_m = np.linalg.norm(legs, axis=1)
        legs, stops = legs[lengths_m > 1e-9], points[1:][lengths_m > 1e-9]
        bearings = np.arctan2(-legs[:, 0], -legs[:, 1])
        turns = wrap_angles(np.diff(np.concatenate([[place.heading_rad], bearings, [goal_heading]])))
        last = float(bearings[-1]) if len(bearings) else place.heading_rad
        sweep = self._sweep(last, goal_heading)
        on_way = self._nearest.query(stops)[1] if len(stops) else np.zeros(0, np.int64)
        rows = np.concatenate([on_way, np.full(len(sweep), row)]).astype(np.int64)
        columns = self._columns(np.concatenate([bearings, sweep]))
        cost = lengths_m.sum() / self._forward_step_m + np.abs(turns).sum() / self._turn_step_rad
        return Way(pose, float(cost), np.bitwise_or.reduce(bits[rows, columns], axis=0))

    def _waypoints(self, place: Place, row: int) -> NDArray[np.float64]:
        cells = place.tree.path_to(self._cells[row])
        assert cells is not None, "a way is asked for to reachable poses only"
        inner = self._frame.centers_of(cells[self._stride : -1 : self._stride].reshape(-1, 2))
        return np.concatenate([place.position_xz[None], inner, self._table.positions_xz[row][None]])

    def _sweep(self, from_rad: float, to_rad: float) -> NDArray[np.float64]:
        """Headings passed while turning the short way, about as dense as the table's."""
        turn = float(wrap_angles(np.asarray(to_rad - from_rad)))
        pitch = 2.0 * np.pi / len(self._table.headings_rad)
        return from_rad + turn * np.linspace(0.0, 1.0, 1 + int(np.ceil(abs(turn) / pitch)))

    def _columns(self, headings_rad: NDArray[np.float64]) -> NDArray[np.int64]:
        count = len(self._table.headings_rad)
        return np.asarray(np.rint(headings_rad * count / (2.0 * np.pi)).astype(np.int64) % count)


def _widened(grid: TraversableGrid) -> tuple[GridFrame, NDArray[np.bool_]]:
    """The navigable floor, on cells of twice the width if it is large; one free cell makes a wide one free.

    Walls stay shut, as the body's radius is on both sides of them; still wider cells would open thin ones.
    """
    free = grid.navigable
    if free.size <= _MAX_CELLS:
        return grid.frame, free
    wide = pooled(np.logical_or, free, 2)
    return GridFrame(grid.frame.origin_xz, 2.0 * grid.frame.cell_m, wide.shape), wide
