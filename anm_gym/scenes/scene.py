"""What a scene is: a checked mesh, the storey that is played, and where both came from.

The dataclasses only; loading is in `load`, `floorplan` and `procedural`, judging in `report`.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.slab import slab_of

SLAB_MARGIN_M = 0.3
"""How far a storey's mesh reaches at most under its floor and over its ceiling: a slab's thickness (ours)."""

SHEET_M = 0.05
"""How far it reaches at least, metres: a sheet is the ceiling of one storey and the floor of the next."""


@dataclass(frozen=True)
class Storey:
    """One level on which the agent can stand."""

    index: int
    """Position counted from the lowest storey, which is 0."""
    floor_y_m: float
    """Height of the floor, metres, world frame."""
    ceiling_y_m: float | None
    """Height of the ceiling, metres, world frame; None where most of the floor is open to the sky."""
    navigable_area_m2: float
    """Area of the largest connected part that the default body can reach, square metres."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A mesh with a known up axis (y), unit (metres) and storey, ready for the simulator.

    Raises:
        SceneError: If `storeys` is empty or none of them has the floor `floor_y_m`.
    """

    name: str
    """Short name for tables: the file's stem, or the procedural name."""
    mesh: TriangleMesh
    """The whole mesh, every storey of it."""
    floor_y_m: float
    """Floor of the selected storey, metres, world frame."""
    ceiling_y_m: float | None
    """Ceiling of the selected storey, metres, world frame; None without one."""
    storeys: tuple[Storey, ...]
    """Every storey, lowest first."""
    source: str
    """Where it came from: a path or a procedural name."""
    repairs: tuple[str, ...] = ()
    """What the loader changed, one sentence each; empty for a sound file."""

    def __post_init__(self) -> None:
        if not self.storeys:
            raise SceneError(f"`storeys` of scene {self.name!r} must have at least one storey, got none")
        if all(storey.floor_y_m != self.floor_y_m for storey in self.storeys):
            floors = ", ".join(f"{storey.floor_y_m:.3f}" for storey in self.storeys)
            raise SceneError(f"`floor_y_m` must be the floor of a storey ({floors}), got {self.floor_y_m}")

    @property
    def storey(self) -> Storey:
        """The selected storey."""
        return next(storey for storey in self.storeys if storey.floor_y_m == self.floor_y_m)

    @cached_property
    def storey_mesh(self) -> TriangleMesh:
        """What of the mesh belongs to the selected storey; all of it where there is but one.

        The mesh is cut in the middle of the slab under the floor and of the one over the ceiling, at most
        0.3 m from them, so that a wall counts as far as this storey has it, and no floor or ceiling of
        another storey does. Without a ceiling it reaches to the slab under the next floor, or has no end.
        """
        if len(self.storeys) == 1:
            return self.mesh
        return slab_of(self.mesh, self._bottom_cut_y_m, self._top_cut_y_m)

    @property
    def storey_top_y_m(self) -> float:
        """Height up to which there is surface of the selected storey, its ceiling's, metres."""
        ceiling_m = np.inf if self.ceiling_y_m is None or len(self.storeys) == 1 else self.ceiling_y_m
        return float(min(ceiling_m, self.storey_mesh.bounds[1, 1]))

    @property
    def _bottom_cut_y_m(self) -> float:
        ceilings = [s.ceiling_y_m for s in self.storeys if s.ceiling_y_m is not None]
        below_m = max((y_m for y_m in ceilings if y_m <= self.floor_y_m + SHEET_M), default=-np.inf)
        middle_m = min((below_m + self.floor_y_m) / 2, self.floor_y_m - SHEET_M)
        return max(self.floor_y_m - SLAB_MARGIN_M, middle_m)

    @property
    def _top_cut_y_m(self) -> float:
        if self.ceiling_y_m is None:
            floors = [s.floor_y_m for s in self.storeys if s.floor_y_m > self.floor_y_m]
            return min(floors, default=np.inf) - SLAB_MARGIN_M / 2
        floors = [s.floor_y_m for s in self.storeys if s.floor_y_m >= self.ceiling_y_m - SHEET_M]
        middle_m = (self.ceiling_y_m + min(floors, default=np.inf)) / 2
        return float(min(self.ceiling_y_m + SLAB_MARGIN_M, max(middle_m, self.ceiling_y_m + SHEET_M)))
