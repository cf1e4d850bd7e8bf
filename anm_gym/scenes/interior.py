"""From a plan to triangles: the mesh is the boundary of the air inside a house.

Walls are given by their middle lines. In each band of heights the air is the rooms less the walls,
plus the openings; its outline becomes wall faces, and where it changes from band to band, lintels
and sills. So no face is hidden inside a wall, none is built twice, and all of them face the air.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np
import shapely
import trimesh
from numpy.typing import NDArray

from anm_gym.mesh import TriangleMesh

WALL_THICKNESS_M: Final = 0.1
"""Thickness of a wall, metres (ours)."""

_SNAP_M: Final = 1e-4
_CLOSE_M: Final = 0.005
_LEVEL_DIGITS: Final = 2
_WALL_RGB: Final = (232, 228, 219)
_CEILING_RGB: Final = (246, 245, 242)
_FLOOR_RGB: Final = {
    "Kitchen": (201, 186, 160),
    "LivingRoom": (176, 137, 98),
    "Bedroom": (158, 120, 88),
    "Bathroom": (172, 188, 196),
}
_PLAIN_FLOOR_RGB: Final = (186, 160, 130)

Outlines = Sequence[tuple[str, NDArray[np.float64]]]


@dataclass(frozen=True, eq=False)
class Opening:
    """A hole through a wall."""

    ends_xz: NDArray[np.float64]
    """(2, 2) float64 ends on the wall's middle line, metres, world frame."""
    bottom_m: float
    """Lower edge over the floor, metres."""
    top_m: float
    """Upper edge over the floor, metres."""

    @property
    def footprint(self) -> shapely.Geometry:
        """The piece of wall that the hole takes away."""
        return shapely.LineString(self.ends_xz).buffer(0.5 * WALL_THICKNESS_M + _SNAP_M, cap_style="flat")

    def is_at(self, height_m: float) -> bool:
        """Whether the hole is open at a height over the floor."""
        return round(self.bottom_m, _LEVEL_DIGITS) < height_m < round(self.top_m, _LEVEL_DIGITS)

    def is_in(self, wall: shapely.Geometry) -> bool:
        """Whether the hole is in a wall, given by its middle line, rather than beside its end."""
        return bool(wall.distance(shapely.Point(self.ends_xz.mean(axis=0))) < _CLOSE_M)


@dataclass(frozen=True, eq=False)
class _Patch:
    corners: NDArray[np.float64]
    color: tuple[int, int, int]


def build_interior(
    rooms: Outlines, walls_xz: NDArray[np.float64], openings: Sequence[Opening], ceiling_m: float
) -> TriangleMesh:
    """Build the inner surfaces of a one-storey house.

    Args:
        rooms: Kind and (N, 2) outline of each room along the middle of its walls, metres.
        walls_xz: (W, 2, 2) float64 ends of the walls' middle lines, metres.
        openings: Holes in the walls.
        ceiling_m: Height of the ceiling, metres; the floor is at y = 0.

    Returns:
        A closed surface that faces the air, coloured by room kind.

    Source:
        Ours.
    """
    floor_plan = _rooms_union(rooms)
    levels = _levels(openings, ceiling_m)
    bands = [_air(floor_plan, walls_xz, openings, 0.5 * (low + high)) for low, high in pairwise(levels)]
    patches = list(_floors(bands[0], rooms))
    patches += _level_patches(bands[-1], ceiling_m, faces_up=False, color=_CEILING_RGB)
    for air, (low, high) in zip(bands, pairwise(levels), strict=True):
        patches.append(_Patch(_sides(air, low, high), _WALL_RGB))
    for below, above, height in zip(bands, bands[1:], levels[1:], strict=False):
        patches += _level_patches(below.difference(above), height, faces_up=False, color=_WALL_RGB)
        patches += _level_patches(above.difference(below), height, faces_up=True, color=_WALL_RGB)
    return _joined(patches)


def _rooms_union(rooms: Outlines) -> shapely.Geometry:
    """Union of the rooms, with the slits closed that rounded coordinates leave between them."""
    union = shapely.union_all([shapely.Polygon(outline) for _, outline in rooms])
    return union.buffer(_CLOSE_M, join_style="mitre").buffer(-_CLOSE_M, join_style="mitre")


def _levels(openings: Sequence[Opening], ceiling_m: float) -> list[float]:
    """Heights between which the plan does not change; those of openings in whole centimetres."""
    edges = {round(edge, _LEVEL_DIGITS) for opening in openings for edge in (opening.bottom_m, opening.top_m)}
    return [0.0, *sorted(edge for edge in edges if 0.0 < edge < ceiling_m), ceiling_m]


def _air(
    floor_plan: shapely.Geometry, walls_xz: NDArray[np.float64], openings: Sequence[Opening], height_m: float
) -> shapely.Geometry:
    holes = [opening for opening in openings if opening.is_at(height_m)]
    walls = shapely.union_all([_solid_wall(shapely.LineString(ends), holes) for ends in walls_xz])
    return shapely.set_precision(floor_plan.difference(walls), _SNAP_M)


def _solid_wall(middle_line: shapely.Geometry, holes: Sequence[Opening]) -> shapely.Geometry:
    """Footprint of a wall without its own holes; those of a wall that ends at it do not cut it."""
    solid = middle_line.buffer(0.5 * WALL_THICKNESS_M, cap_style="square")
    return solid.difference(shapely.union_all([hole.footprint for hole in holes if hole.is_in(middle_line)]))


def _floors(air: shapely.Geometry, rooms: Outlines) -> Iterable[_Patch]:
    """Share the floor among the rooms by colour; what belongs to none of them is plain."""
    rest = air
    for kind, outline in rooms:
        room = shapely.Polygon(outline).buffer(_CLOSE_M, join_style="mitre")
        color = _FLOOR_RGB.get(kind, _PLAIN_FLOOR_RGB)
        yield from _level_patches(rest.intersection(room), 0.0, faces_up=True, color=color)
        rest = rest.difference(room)
    yield from _level_patches(rest, 0.0, faces_up=True, color=_PLAIN_FLOOR_RGB)


def _polygons(area: shapely.Geometry) -> list[Any]:
    """The polygons of an area, without the lines, points and specks that cutting leaves."""
    parts = shapely.get_parts(shapely.set_precision(area, _SNAP_M))
    return [part for part in parts.tolist() if part.geom_type == "Polygon" and part.area > _SNAP_M]


def _level_patches(
    area: shapely.Geometry, height_m: float, *, faces_up: bool, color: tuple[int, int, int]
) -> list[_Patch]:
    patches = []
    for polygon in _polygons(area):
        points, faces = trimesh.creation.triangulate_polygon(polygon, engine="earcut")
        triangles = np.asarray(points, np.float64)[np.asarray(faces)]
        first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        looks_up = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] < 0.0
        triangles[looks_up != faces_up] = triangles[looks_up != faces_up, ::-1]
        corners = np.insert(triangles, 1, height_m, axis=2)
        patches.append(_Patch(corners, color))
    return patches


def _sides(air: shapely.Geometry, low_m: float, high_m: float) -> NDArray[np.float64]:
    """(2 E, 3, 3) upright faces along the E edges of the air's outline, facing the air."""
    edges = [
        edge
        for polygon in _polygons(air)
        for ring in (shapely.geometry.polygon.orient(polygon),)
        for line in (ring.exterior, *ring.interiors)
        for edge in pairwise(np.asarray(line.coords)[:, :2])
    ]
    start, end = np.array(edges).reshape(-1, 2, 2).transpose(1, 0, 2)
    quads = [np.insert(points, 1, height, axis=1) for points, height in _corners(start, end, low_m, high_m)]
    near, far, far_top, near_top = quads
    return np.concatenate(
        [np.stack([near, far, far_top], axis=1), np.stack([near, far_top, near_top], axis=1)]
    )


def _corners(
    start: NDArray[np.float64], end: NDArray[np.float64], low_m: float, high_m: float
) -> list[tuple[NDArray[np.float64], float]]:
    return [(start, low_m), (end, low_m), (end, high_m), (start, high_m)]


def _joined(patches: Sequence[_Patch]) -> TriangleMesh:
    """One mesh out of patches; equal corners become one vertex."""
    corners = np.concatenate([patch.corners for patch in patches])
    vertices, index = np.unique(corners.reshape(-1, 3).round(6) + 0.0, axis=0, return_inverse=True)
    colors = np.concatenate([np.tile(np.array(p.color, np.uint8), (len(p.corners), 1)) for p in patches])
    return TriangleMesh(vertices, index.reshape(-1, 3).astype(np.int32), colors)
