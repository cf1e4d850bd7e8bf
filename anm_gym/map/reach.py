"""The part of the known floor that the agent can reach, with the paths to it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from anm_gym.map.occupancy import OccupancyGrid
from anm_gym.sim.geodesic import GeodesicTree, GridGraph, nearest_free_cell
from anm_gym.sim.grid import GridFrame

ESCAPE_M = 0.5
"""How far from an agent that stands too close to an obstacle the nearest passable cell may be, metres."""


@dataclass(frozen=True, eq=False)
class ReachSettings:
    """What counts as passable and as comfortable (ours)."""

    radius_m: float = 0.15
    """Clearance that a path keeps from known obstacles, metres: the body and half a cell's diagonal."""
    comfort_m: float = 0.35
    """Clearance under which a path costs more, metres."""
    tightness_cost: float = 3.0
    """Factor on the length of a path that touches obstacles, 1 where there is comfort."""
    through_unknown: bool = False
    """Count unknown cells as passable, at `tightness_cost`."""


@dataclass(frozen=True, eq=False)
class ReachableSpace:
    """Cheapest paths from the agent to every cell that it can reach."""

    frame: GridFrame
    """The window of the grid that was searched."""
    cost_m: NDArray[np.float64]
    """(rows, columns) length of the cheapest path, weighted by tightness, metres; infinite elsewhere."""
    clearance_m: NDArray[np.float32]
    """(rows, columns) distance to the nearest known obstacle, metres."""
    passable: NDArray[np.bool_]
    """(rows, columns): the body fits as far as is known."""
    tree: GeodesicTree
    """The paths."""

    @property
    def reachable(self) -> NDArray[np.bool_]:
        """(rows, columns): there is a path."""
        return np.isfinite(self.cost_m)

    def cost_to(self, position_xz: ArrayLike, tolerance_m: float = 0.0) -> float:
        """Cost of the way to a floor point or to the reachable cell nearest to it, metres."""
        cell = self._reachable_cell(position_xz, tolerance_m)
        return float("inf") if cell is None else float(self.cost_m[cell[0], cell[1]])

    def path_to(self, position_xz: ArrayLike, tolerance_m: float = 0.0) -> NDArray[np.float64] | None:
        """Path to a floor point or to the reachable cell nearest to it.

        Args:
            position_xz: (2,) floor point, metres.
            tolerance_m: How far from it the path may end, metres.

        Returns:
            (L, 2) floor points from the agent's cell on, or None.
        """
        cell = self._reachable_cell(position_xz, tolerance_m)
        cells = None if cell is None else self.tree.path_to(cell)
        return None if cells is None else self.frame.centers_of(cells)

    def _reachable_cell(self, position_xz: ArrayLike, tolerance_m: float) -> NDArray[np.int64] | None:
        cell = self.frame.cells_of(position_xz)[0]
        return nearest_free_cell(self.reachable, cell, int(tolerance_m / self.frame.cell_m))


def reachable_space(
    occupancy: OccupancyGrid, position_xz: ArrayLike, settings: ReachSettings | None = None
) -> ReachableSpace | None:
    """Search the known floor from the agent's position.

    Args:
        occupancy: What is known of the floor.
        position_xz: (2,) where the agent stands, metres.
        settings: What counts as passable.

    Returns:
        The reachable space, or None if nothing near the agent is passable.
    """
    settings = settings or ReachSettings()
    passable = ~occupancy.occupied if settings.through_unknown else occupancy.free
    passable = passable & (occupancy.clearance_m > settings.radius_m)
    reluctant = occupancy.unknown if settings.through_unknown else None
    return search(passable, occupancy.clearance_m, occupancy.frame, position_xz, settings, reluctant)


def search(
    passable: NDArray[np.bool_],
    clearance_m: NDArray[np.float32],
    frame: GridFrame,
    position_xz: ArrayLike,
    settings: ReachSettings,
    reluctant: NDArray[np.bool_] | None = None,
) -> ReachableSpace | None:
    """Search any grid; see `reachable_space`.

    Args:
        passable: (rows, columns) bool.
        clearance_m: (rows, columns) metres.
        frame: Where the cells lie.
        position_xz: (2,) where the agent stands, metres.
        settings: Comfort and its price.
        reluctant: (rows, columns) cells that cost as much as tight ones.
    """
    start = nearest_free_cell(passable, frame.cells_of(position_xz)[0], int(ESCAPE_M / frame.cell_m))
    if start is None:
        return None
    labels, _ = ndimage.label(passable)
    part = labels == labels[start[0], start[1]]
    rows, columns = np.flatnonzero(part.any(axis=1)), np.flatnonzero(part.any(axis=0))
    window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    tightness = np.clip(1.0 - clearance_m[window] / settings.comfort_m, 0.0, 1.0)
    if reluctant is not None:
        tightness = np.maximum(tightness, reluctant[window])
    graph = GridGraph(part[window], frame.cell_m, 1.0 + (settings.tightness_cost - 1.0) * tightness)
    tree = graph.tree_from(start - [rows[0], columns[0]])
    origin = frame.origin_xz + frame.cell_m * np.array([columns[0], rows[0]])
    cropped = GridFrame((float(origin[0]), float(origin[1])), frame.cell_m, part[window].shape)
    return ReachableSpace(cropped, tree.distance_m, clearance_m[window], passable[window], tree)
