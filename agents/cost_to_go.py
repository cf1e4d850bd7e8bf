"""Cost-to-go: what it costs to reach the goal from every cell of the floor near the agent."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from anm_gym.checks import check_at_least, check_positive
from anm_gym.map.occupancy import clearance_of
from anm_gym.sim.geodesic import GridGraph, nearest_free_cell
from anm_gym.sim.grid import GridFrame

FAR_M = 1e6
"""Cost of a cell from which the goal cannot be reached: finite, so that it can be interpolated."""
RIM_CELLS = 2
"""Cells beyond the reachable ones that get a cost too, for interpolation."""


@dataclass(frozen=True)
class CostSettings:
    """What the floor costs (ours)."""

    radius_m: float = 0.09
    """Clearance that a path needs, metres: the body's radius, less a rounding of the raster."""
    comfort_m: float = 0.3
    """Clearance from which on a path costs its length, metres."""
    tightness_cost: float = 4.0
    """Factor on the length of a path that touches obstacles; falls to 1 with the square of comfort."""
    unknown_cost: float | None = 4.0
    """Factor on the length of a path through unknown cells; None forbids them."""
    escape_m: float = 0.25
    """Around the agent clearance is waived, metres: it may have to squeeze out."""
    margin_m: float = 2.5
    """The search covers agent and goal with this margin first, then the whole floor, metres."""

    def __post_init__(self) -> None:
        check_at_least(self, 0.0, "radius_m", "escape_m", "margin_m")
        check_at_least(self, 1.0, "tightness_cost")
        check_positive(self, "comfort_m")
        if self.unknown_cost is not None:
            check_at_least(self, 0.0, "unknown_cost")


@dataclass(frozen=True, eq=False)
class Floor:
    """What a navigator knows of the floor."""

    frame: GridFrame
    """Where the cells lie."""
    occupied: NDArray[np.bool_]
    """(rows, columns): obstacles, and where there is no floor."""
    unknown: NDArray[np.bool_]
    """(rows, columns): never seen."""
    stood: NDArray[np.bool_]
    """(rows, columns): the agent has been here, so it fits, whatever was felt beside it."""

    @cached_property
    def clearance_m(self) -> NDArray[np.float32]:
        """(rows, columns) float32 distance to the nearest occupied cell, metres."""
        return clearance_of(self.occupied, self.frame.cell_m)

    def window(self, points_xz: ArrayLike, margin_m: float) -> "Floor":
        """Cut out the box around (N, 2) floor points and a margin; beyond the raster all is unknown."""
        cells, shape = self.frame.cells_of(points_xz), np.asarray(self.frame.shape)
        margin = int(np.ceil(margin_m / self.frame.cell_m))
        low, high = cells.min(axis=0) - margin, cells.max(axis=0) + margin + 1
        inner_low, inner_high = np.clip(low, 0, shape), np.clip(high, 0, shape)
        inner = np.s_[inner_low[0] : inner_high[0], inner_low[1] : inner_high[1]]
        size = (int(high[0] - low[0]), int(high[1] - low[1]))
        occupied, unknown, stood = np.zeros(size, bool), np.ones(size, bool), np.zeros(size, bool)
        target = np.s_[
            inner_low[0] - low[0] : inner_high[0] - low[0], inner_low[1] - low[1] : inner_high[1] - low[1]
        ]
        occupied[target], unknown[target] = self.occupied[inner], self.unknown[inner]
        stood[target] = self.stood[inner]
        x, z = np.asarray(self.frame.origin_xz) + self.frame.cell_m * low[::-1]
        return Floor(GridFrame((float(x), float(z)), self.frame.cell_m, size), occupied, unknown, stood)

    def price(self, settings: CostSettings) -> NDArray[np.float32]:
        """(rows, columns) float32 factor on the length of a path by its clearance; at least 1."""
        lack = np.clip(1.0 - self.clearance_m / settings.comfort_m, 0.0, 1.0)
        price = 1.0 + (settings.tightness_cost - 1.0) * lack**2
        if settings.unknown_cost is not None:
            price = np.where(self.unknown, np.maximum(price, settings.unknown_cost), price)
        return np.asarray(price, np.float32)

    def passable(self, position_xz: ArrayLike, settings: CostSettings) -> NDArray[np.bool_]:
        """(rows, columns): the body fits, or the agent is so near that it has to try."""
        fits = self.clearance_m > settings.radius_m
        if settings.unknown_cost is None:
            fits &= ~self.unknown
        row, column = self.frame.cells_of(position_xz)[0]
        rows, columns = np.ogrid[: self.frame.shape[0], : self.frame.shape[1]]
        reach = settings.escape_m / self.frame.cell_m
        near = (rows - row) ** 2 + (columns - column) ** 2 <= reach**2
        fits |= near & ~self.occupied
        fits[row, column] = True
        return fits | self.stood


@dataclass(frozen=True, eq=False)
class CostToGo:
    """Cost of the cheapest path from each cell of a window to the goal."""

    frame: GridFrame
    """The window."""
    cost_m: NDArray[np.float64]
    """(rows, columns) metres, weighted by the price of the floor; `FAR_M` where there is no path."""
    end_xz: NDArray[np.float64]
    """(2,) where the paths end: the goal, or the reachable cell nearest to it, metres."""

    @cached_property
    def heading_rad(self) -> NDArray[np.float64]:
        """(rows, columns) heading of steepest descent, radians."""
        smooth = ndimage.uniform_filter(np.minimum(self.cost_m, self.highest_m), 5)
        along_z, along_x = np.gradient(smooth)
        return np.asarray(np.arctan2(along_x, along_z))

    @property
    def highest_m(self) -> float:
        """Highest cost of a cell from which the goal can be reached, metres."""
        return float(self.cost_m[self.cost_m < FAR_M].max())

    def heading_at(self, points_xz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heading of steepest descent at (N, 2) floor points inside the window or beside it, radians."""
        cells = np.clip(self.frame.cells_of(points_xz), 0, np.array(self.frame.shape) - 1)
        return self.heading_rad[cells[:, 0], cells[:, 1]]

    def at(self, points_xz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Interpolated cost at (N, 2) floor points, metres; `FAR_M` outside the window."""
        scaled = (points_xz - self.frame.origin_xz) / self.frame.cell_m - 0.5
        return np.asarray(
            ndimage.map_coordinates(
                self.cost_m, [scaled[:, 1], scaled[:, 0]], order=1, mode="constant", cval=FAR_M
            )
        )


def cost_to_go(
    floor: Floor, position_xz: ArrayLike, goal_xz: ArrayLike, settings: CostSettings, tolerance_m: float
) -> CostToGo | None:
    """Search the floor backwards from the goal.

    Args:
        floor: What is known of it.
        position_xz: (2,) where the agent stands, metres.
        goal_xz: (2,) where it wants to go, metres.
        settings: What the floor costs.
        tolerance_m: How far from the goal a path may end, metres.

    Returns:
        The costs, or None if there is no path.
    """
    ends = np.stack([position_xz, goal_xz])
    found = _search(floor.window(ends, settings.margin_m), position_xz, goal_xz, settings, tolerance_m)
    if found is not None:
        return found
    corners = floor.frame.centers_of(np.array([(0, 0), np.subtract(floor.frame.shape, 1)]))
    whole = floor.window(np.concatenate([ends, corners]), 0.0)
    return _search(whole, position_xz, goal_xz, settings, tolerance_m)


def _search(
    floor: Floor, position_xz: ArrayLike, goal_xz: ArrayLike, settings: CostSettings, tolerance_m: float
) -> CostToGo | None:
    frame = floor.frame
    start = frame.cells_of(position_xz)[0]
    labels, _ = ndimage.label(floor.passable(position_xz, settings))
    part = labels == labels[start[0], start[1]]
    goal = nearest_free_cell(part, frame.cells_of(goal_xz)[0], round(tolerance_m / frame.cell_m))
    if goal is None:
        return None
    cost = GridGraph(part, frame.cell_m, floor.price(settings)).distance_from(goal)
    is_exact = bool((goal == frame.cells_of(goal_xz)[0]).all())
    end = np.asarray(goal_xz, np.float64) if is_exact else frame.centers_of(goal)[0]
    return CostToGo(frame, _with_rim(cost, settings.tightness_cost * frame.cell_m), end)


def _with_rim(cost: NDArray[np.float64], step_m: float) -> NDArray[np.float64]:
    """Give the cells beside reachable ones a finite cost, the rest `FAR_M`."""
    filled = cost
    for _ in range(RIM_CELLS):
        beside = ndimage.minimum_filter(filled, size=3) + step_m
        filled = np.where(np.isinf(filled), beside, filled)
    return np.where(np.isinf(filled), FAR_M, filled)
