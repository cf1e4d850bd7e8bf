"""The part of the known floor that the agent can reach, and what the way there costs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.checks import check_at_least, check_positive
from anm_gym.map.occupancy import OccupancyGrid
from anm_gym.sim.geodesic import GridGraph, nearest_free_cell
from anm_gym.sim.grid import GridFrame

ESCAPE_M = 0.5
"""How far from an agent that stands too close to an obstacle the nearest passable cell may be, metres."""


@dataclass(frozen=True)
class ReachSettings:
    """What counts as passable and as comfortable (ours)."""

    radius_m: float = 0.15
    """Clearance that a path keeps from known obstacles, metres: the body and half a cell's diagonal."""
    tight_radius_m: float = 0.1
    """Clearance that will do where the agent would be caught otherwise, metres: the body alone."""
    pocket_m2: float = 0.5
    """An agent that reaches less floor than this may be caught, square metres."""
    comfort_m: float = 0.35
    """Clearance under which a path costs more, metres."""
    tightness_cost: float = 3.0
    """Factor on the length of a path that touches obstacles, 1 where there is comfort."""
    through_unknown: bool = False
    """Count unknown cells as passable, at `tightness_cost`."""

    def __post_init__(self) -> None:
        check_positive(self, "radius_m", "tight_radius_m", "comfort_m")
        check_at_least(self, 0.0, "pocket_m2")
        check_at_least(self, 1.0, "tightness_cost")


@dataclass(frozen=True, eq=False)
class ReachableSpace:
    """Cost of the cheapest path from the agent to every cell that it can reach."""

    frame: GridFrame
    """The window of the grid that was searched."""
    cost_m: NDArray[np.float64]
    """(rows, columns) length of the cheapest path, weighted by tightness, metres; infinite elsewhere."""

    @property
    def reachable(self) -> NDArray[np.bool_]:
        """(rows, columns): there is a path."""
        return np.isfinite(self.cost_m)

    @property
    def area_m2(self) -> float:
        """Floor that can be reached, square metres."""
        return float(self.reachable.sum()) * self.frame.cell_m**2

    def cost_to(self, position_xz: ArrayLike, tolerance_m: float = 0.0) -> float:
        """Cost of the way to a floor point or to the reachable cell nearest to it.

        Args:
            position_xz: (2,) floor point, metres.
            tolerance_m: How far from it the way may end, metres.

        Returns:
            Weighted metres; infinite if there is no way.
        """
        cell = self.frame.cells_of(position_xz)[0]
        near = nearest_free_cell(self.reachable, cell, round(tolerance_m / self.frame.cell_m))
        return float("inf") if near is None else float(self.cost_m[near[0], near[1]])


def reachable_space(
    occupancy: OccupancyGrid, position_xz: ArrayLike, settings: ReachSettings | None = None
) -> ReachableSpace | None:
    """Search the known floor from the agent's position.

    An agent that starts in a corner among furniture may stand where the usual clearance leads nowhere; then
    the clearance of its body will do.

    Args:
        occupancy: What is known of the floor.
        position_xz: (2,) where the agent stands, metres.
        settings: What counts as passable.

    Returns:
        The reachable space, or None if nothing near the agent is passable.
    """
    settings = settings or ReachSettings()
    space = _searched(occupancy, position_xz, settings, settings.radius_m)
    if space is None or space.area_m2 < settings.pocket_m2:
        squeezed = _searched(occupancy, position_xz, settings, settings.tight_radius_m)
        if squeezed is not None and squeezed.area_m2 >= settings.pocket_m2:
            return squeezed
    return space


def _searched(
    occupancy: OccupancyGrid, position_xz: ArrayLike, settings: ReachSettings, radius_m: float
) -> ReachableSpace | None:
    """Search what is passable with a clearance."""
    frame = occupancy.frame
    passable = occupancy.traversable(radius_m, through_unknown=settings.through_unknown)
    start = nearest_free_cell(passable, frame.cells_of(position_xz)[0], round(ESCAPE_M / frame.cell_m))
    if start is None:
        return None
    rows, columns = np.flatnonzero(passable.any(axis=1)), np.flatnonzero(passable.any(axis=0))
    window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    tightness = np.clip(1.0 - occupancy.clearance_m[window] / settings.comfort_m, 0.0, 1.0)
    if settings.through_unknown:
        tightness = np.maximum(tightness, occupancy.unknown[window])
    graph = GridGraph(passable[window], frame.cell_m, 1.0 + (settings.tightness_cost - 1.0) * tightness)
    cost_m = graph.distance_from(start - [rows[0], columns[0]])
    x, z = np.asarray(frame.origin_xz) + frame.cell_m * np.array([columns[0], rows[0]])
    return ReachableSpace(GridFrame((float(x), float(z)), frame.cell_m, cost_m.shape), cost_m)
