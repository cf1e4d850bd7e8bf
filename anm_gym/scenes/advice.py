"""What may spoil an experiment on a mesh, and what to do about it: one sentence each."""

from collections.abc import Iterator, Sequence
from typing import Final, Protocol

from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.axes import METRES_PER_UNIT, flat_area_peaks_m2
from anm_gym.scenes.probes import Surroundings

MANY_TRIANGLES: Final = 1_500_000
"""Above this, loading and metrics take long; depth does not (ours)."""

_ROOM_HEIGHTS_M: Final = (2.0, 6.0)
_LIKELY_HEIGHTS_M: Final = (2.2, 4.0)
_LEVEL_ESCAPE: Final = 0.02
_BACK_FACES: Final = 0.05
_DUPLICATES: Final = 0.01
_LARGE_PART: Final = 0.2
_TILT_DEG: Final = 0.3


class ExaminedStorey(Protocol):
    """What the advice needs to know of a storey."""

    @property
    def index(self) -> int:
        """Position counted from the lowest."""

    @property
    def height_m(self) -> float | None:
        """Floor to ceiling, metres."""

    @property
    def parts_m2(self) -> tuple[float, ...]:
        """Connected navigable areas, square metres, largest first."""

    @property
    def tilt_deg(self) -> float:
        """How far the floor is from level, degrees."""

    @property
    def beside(self) -> tuple[tuple[float, float], ...]:
        """Height (metres) and area (square metres) of floors a step up or down."""

    @property
    def surroundings(self) -> Surroundings:
        """What rays meet."""


def report_warnings(
    mesh: TriangleMesh, storeys: Sequence[ExaminedStorey], num_duplicates: int
) -> tuple[str, ...]:
    """Collect every warning about a mesh.

    Args:
        mesh: The mesh, metres, y up.
        storeys: Its storeys, examined.
        num_duplicates: Faces that repeat another one.

    Returns:
        One sentence each, with a remedy; empty for a fit mesh.
    """
    warnings = list(_about_mesh(mesh, num_duplicates))
    for storey in storeys:
        name = f"storey {storey.index}"
        warnings += [f"{name} {text}" for text in (*_about_shape(storey), *_about_rays(storey.surroundings))]
    return tuple(warnings)


def suspected_unit(height_m: float) -> str | None:
    """Name the unit in which a storey's height, taken for metres, would be a room's; None if none fits."""
    if _ROOM_HEIGHTS_M[0] <= height_m <= _ROOM_HEIGHTS_M[1]:
        return None
    low_m, high_m = _LIKELY_HEIGHTS_M
    return next(
        (unit for unit, metres in METRES_PER_UNIT.items() if low_m <= height_m * metres <= high_m), None
    )


def _about_mesh(mesh: TriangleMesh, num_duplicates: int) -> Iterator[str]:
    across_x, up, across_z = flat_area_peaks_m2(mesh).tolist()
    if max(across_x, across_z) > up:
        axis = "x" if across_x > across_z else "z"
        yield f"the largest flat surface lies across {axis}, not y: check `up_axis`"
    if len(mesh.faces) > MANY_TRIANGLES:
        yield (
            f"{len(mesh.faces):,} triangles: loading and metrics take long; "
            f"decimate to under {MANY_TRIANGLES:,} if that matters"
        )
    if num_duplicates > _DUPLICATES * len(mesh.faces):
        yield f"{num_duplicates:,} faces are there twice: completion counts them twice; remove duplicates"


def _about_shape(storey: ExaminedStorey) -> Iterator[str]:
    if storey.height_m is None:
        yield "has no ceiling: depth is empty towards the sky and free space is open upwards; fine if meant"
    else:
        unit = suspected_unit(storey.height_m)
        if unit is not None:
            yield f"is {storey.height_m:.1f} m high: the file may be in {unit!r}; check `unit`"
    if storey.tilt_deg > _TILT_DEG:
        yield (
            f"tilts by {storey.tilt_deg:.1f} degrees: floor that lies 5 cm below or 10 cm above its main "
            "height is not walked on; level the mesh"
        )
    if storey.beside:
        floors = ", ".join(f"{area_m2:.1f} m2 at y = {y_m:.2f} m" for y_m, area_m2 in storey.beside)
        yield (
            f"does not reach {floors}: a step down of more than 5 cm or up of more than 10 cm is not taken; "
            "level the mesh if these are rooms"
        )
    largest, *others = storey.parts_m2
    cut_off = [area for area in others if area >= _LARGE_PART * largest]
    if cut_off:
        areas = ", ".join(f"{area:.1f}" for area in cut_off)
        yield (
            f"has large parts ({areas} m2) that cannot be reached from the largest: "
            "score against what is reachable, or open a passage"
        )


def _about_rays(surroundings: Surroundings) -> Iterator[str]:
    if surroundings.level_escape_share > _LEVEL_ESCAPE:
        yield (
            f"loses {surroundings.level_escape_share:.0%} of the level rays: windows, doors or walls are "
            "missing; depth is empty there, close them if a map must be closed"
        )
    if surroundings.back_face_share > _BACK_FACES:
        yield (
            f"shows back faces to {surroundings.back_face_share:.0%} of the rays: the winding is mixed, so "
            "do not cull faces or trust normals; make the winding consistent if a method needs it"
        )
