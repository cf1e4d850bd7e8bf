"""What a scene is: a checked mesh, the storey that is played, and where both came from.

The dataclasses only; loading is in `load`, `floorplan` and `procedural`, judging in `report`.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh

SLAB_MARGIN_M = 0.3
"""How far a storey's mesh reaches under its floor and over its ceiling: a slab's thickness (ours)."""


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
        """The triangles that touch the selected storey; all of them where there is but one.

        A triangle counts when it reaches into [floor - 0.3 m, ceiling + 0.3 m]; without a ceiling
        the next storey's floor bounds it, or nothing.
        """
        if len(self.storeys) == 1:
            return self.mesh
        low_m, high_m = self.floor_y_m - SLAB_MARGIN_M, self._top_y_m + SLAB_MARGIN_M
        heights_m = self.mesh.triangles[:, :, 1]
        kept = (heights_m.max(axis=1) >= low_m) & (heights_m.min(axis=1) <= high_m)
        colors = self.mesh.face_colors
        return TriangleMesh(
            self.mesh.vertices, self.mesh.faces[kept], None if colors is None else colors[kept]
        )

    @property
    def storey_top_y_m(self) -> float:
        """How high `storey_mesh` is the selected storey's, metres; its tall triangles may reach farther."""
        return float(min(self._top_y_m if len(self.storeys) > 1 else np.inf, self.storey_mesh.bounds[1, 1]))

    @property
    def _top_y_m(self) -> float:
        if self.ceiling_y_m is not None:
            return self.ceiling_y_m
        above = [s.floor_y_m for s in self.storeys if s.floor_y_m > self.floor_y_m]
        return min(above, default=float(np.inf))
