"""Where the agent's body fits on a storey: the true traversable grid of a mesh."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.geodesic import GridGraph
from anm_gym.sim.grid import GridFrame
from anm_gym.sim.indoors import INDOORS_M2, between_walls, bridged, is_enclosed, with_roofed_first
from anm_gym.sim.raster import rasterise_slab

FLOOR_TOLERANCE_M = 0.05
"""Surfaces this far below the floor still carry the agent, metres."""
MAX_CELLS = 25_000_000
"""Cells of the largest raster, 250 m square at the default cell; beyond it the unit is wrong."""
ROOF_M = 8.0
"""Highest roof over a floor, metres; what is higher may be a sky (ours)."""
ROOM_M = 20.0
"""How far the walls of a room without a roof may be, metres (ours)."""
CONTACT_M = 1e-6
"""The body touches where the clearance is its radius to within this, metres; above float32's rounding."""

_CORNERS = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])


@dataclass(frozen=True)
class BodySpec:
    """The agent's body, an upright cylinder.

    Source:
        Habitat's default agent, which Active Neural Mapping uses.
    """

    radius_m: float = 0.1
    """Radius, metres."""
    height_m: float = 1.5
    """Height, metres."""
    climb_m: float = 0.1
    """Obstacles lower than this are stepped over, metres."""

    def __post_init__(self) -> None:
        if not self.radius_m > 0.0 or not 0.0 <= self.climb_m < self.height_m:
            raise ValueError(
                "`radius_m` must be > 0 and `climb_m` in [0, height_m), got "
                f"{self.radius_m}, {self.climb_m} and {self.height_m}"
            )


@dataclass(frozen=True, eq=False)
class TraversableGrid:
    """A floor raster with clearances; build it with `from_mesh`."""

    frame: GridFrame
    """Where the cells lie."""
    body: BodySpec
    """The body that it was built for."""
    has_floor: NDArray[np.bool_]
    """(rows, columns): some surface at floor height, or a gap in it that is no wider than the body. Where a
    house stands on open ground, only what is indoors."""
    occupied: NDArray[np.bool_]
    """(rows, columns): some surface in the body's slab of heights."""
    clearance_m: NDArray[np.float32]
    """(rows, columns) distance to the nearest cell that is occupied or has no floor, metres."""
    component: NDArray[np.int32]
    """(rows, columns) label of the connected navigable part: 0 for none, 1 for the largest; where a house
    stands on open ground, parts under a roof come first."""

    @classmethod
    def from_mesh(
        cls, mesh: TriangleMesh, floor_y_m: float, body: BodySpec | None = None, cell_m: float = 0.05
    ) -> "TraversableGrid":
        """Project the triangles of the body's slab on the floor.

        Args:
            mesh: The scene.
            floor_y_m: Height of the storey's floor, metres.
            body: The agent's body.
            cell_m: Edge of a cell, metres.

        Raises:
            SceneError: If no triangle lies at the floor's height, or the mesh is too large.
        """
        body = body or BodySpec()
        bounds = mesh.bounds
        frame = GridFrame.around(bounds[0, [0, 2]], bounds[1, [0, 2]], cell_m)
        if frame.shape[0] * frame.shape[1] > MAX_CELLS:
            size_m = " x ".join(f"{side:.0f}" for side in (bounds[1] - bounds[0])[[0, 2]])
            raise SceneError(
                f"the floor raster must have at most {MAX_CELLS} cells, got {size_m} m at {cell_m} m a cell"
                "; check the mesh's `unit`"
            )
        low, top = floor_y_m + body.climb_m, floor_y_m + body.height_m
        has_floor = rasterise_slab(mesh.triangles, frame, floor_y_m - FLOOR_TOLERANCE_M, low)
        if not has_floor.any():
            raise SceneError(f"the mesh must have a floor at y = {floor_y_m:.2f} m, got none; check `storey`")
        has_floor = bridged(has_floor, round(2.0 * body.radius_m / cell_m))
        occupied = rasterise_slab(mesh.triangles, frame, low, top)
        open_floor = has_floor & ~occupied
        clearance, component = _fit(open_floor, body, cell_m)
        if not is_enclosed(component == 1, occupied, open_floor, body.radius_m / cell_m):
            roof = rasterise_slab(mesh.triangles, frame, top, floor_y_m + ROOF_M)
            indoors = has_floor & (roof | between_walls(occupied, round(ROOM_M / cell_m)))
            inner_clearance, inner = _fit(indoors & ~occupied, body, cell_m)
            large = np.bincount(inner.ravel())[1:] * cell_m**2 >= INDOORS_M2
            if large.any():
                has_floor, clearance = indoors, inner_clearance
                component = with_roofed_first(inner, roof, large)
        return cls(frame, body, has_floor, occupied, clearance, component)

    @cached_property
    def navigable(self) -> NDArray[np.bool_]:
        """(rows, columns) bool: the clearance at the cell's centre exceeds the body's radius."""
        return np.asarray(self.component > 0)

    @cached_property
    def graph(self) -> GridGraph:
        """The graph of the navigable cells."""
        return GridGraph(self.navigable, self.frame.cell_m)

    @cached_property
    def component_areas_m2(self) -> tuple[float, ...]:
        """Area of each connected navigable part, square metres, in the order of their labels."""
        counts = np.bincount(self.component.ravel())[1:]
        return tuple(float(count) * self.frame.cell_m**2 for count in counts)

    @property
    def navigable_area_m2(self) -> float:
        """Area of all navigable parts, square metres."""
        return float(sum(self.component_areas_m2))

    def clearance_at(self, position_xz: ArrayLike) -> float:
        """Interpolated clearance at a floor point, metres; 0 outside the raster."""
        row, column = self._raster_place(position_xz)
        rows, columns = self.frame.shape
        if not (0.0 <= row < rows - 1 and 0.0 <= column < columns - 1):
            return 0.0
        top, left = int(row), int(column)
        down, right = row - top, column - left
        corners = self.clearance_m[top : top + 2, left : left + 2]
        upper = (1.0 - right) * float(corners[0, 0]) + right * float(corners[0, 1])
        lower = (1.0 - right) * float(corners[1, 0]) + right * float(corners[1, 1])
        return (1.0 - down) * upper + down * lower

    def is_navigable(self, position_xz: ArrayLike) -> bool:
        """Tell whether the body fits at a floor point: the interpolated clearance exceeds its radius."""
        return self.clearance_at(position_xz) > self.body.radius_m + CONTACT_M

    def cell_at(self, position_xz: ArrayLike) -> NDArray[np.int64] | None:
        """Navigable cell that stands for a floor point, (2,) row and column; None if there is none.

        The one that holds the point or, beside a wall, the nearest of the cells that surround it; a
        point where the body fits always has one.
        """
        row, column = self._raster_place(position_xz)
        corner = np.floor([row, column]).astype(np.int64)
        cells = corner + _CORNERS
        weights = np.abs(1.0 - _CORNERS - ([row, column] - corner)).prod(axis=1)
        usable = self.frame.contains(cells)
        usable[usable] = self.navigable[cells[usable, 0], cells[usable, 1]]
        return cells[np.where(usable, weights, -1.0).argmax()] if usable.any() else None

    def component_at(self, position_xz: ArrayLike) -> int:
        """Label of the connected part in which the body stands at a floor point; 0 where it does not fit."""
        if not self.is_navigable(position_xz):
            return 0
        cell = self.cell_at(position_xz)
        return 0 if cell is None else int(self.component[cell[0], cell[1]])

    def sample_position(self, rng: np.random.Generator, component: int = 1) -> NDArray[np.float64]:
        """Draw the centre of a cell of a navigable part uniformly, (2,) x and z in metres.

        Raises:
            SceneError: If the part does not exist.
        """
        cells = np.argwhere(self.component == component)
        if component < 1 or len(cells) == 0:
            raise SceneError(
                f"the storey must have a navigable part {component}, got {len(self.component_areas_m2)} parts"
            )
        chosen = cells[rng.integers(len(cells))]
        return np.asarray(self.frame.centers_of(chosen)[0])

    def _raster_place(self, position_xz: ArrayLike) -> tuple[float, float]:
        """Row and column of a floor point, counted between the centres of the cells."""
        x, z = (np.asarray(position_xz, np.float64) - self.frame.origin_xz) / self.frame.cell_m - 0.5
        return float(z), float(x)


def _fit(
    open_floor: NDArray[np.bool_], body: BodySpec, cell_m: float
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Clearance on a floor, metres, and the connected parts where the body fits."""
    padded = np.pad(open_floor, 1)
    clearance = (cell_m * ndimage.distance_transform_edt(padded)[1:-1, 1:-1]).astype(np.float32)
    return clearance, _components(clearance > body.radius_m + CONTACT_M)


def _components(navigable: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Label connected parts (four neighbours, as corners are not cut), the largest first."""
    labels, count = ndimage.label(navigable)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)[1:]
    rank = np.zeros(count + 1, np.int32)
    rank[np.argsort(-sizes, kind="stable") + 1] = np.arange(1, count + 1)
    return np.asarray(rank[labels], np.int32)
