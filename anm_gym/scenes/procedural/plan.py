"""Value types of a floor plan: rectangles, rooms, walls, openings and the whole layout.

Plans are drawn in whole centimetres in their own axis-aligned frame, so that walls meet exactly; only
`Layout.world_xz` knows how the home is turned in the world.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.scenes.procedural.tiers import CORRIDOR

OUTSIDE = -1
"""Room index of everything that is not inside the home."""
EXTERIOR_HALF_CM = 10
"""Half the thickness of a wall to the outside, centimetres."""
INTERIOR_HALF_CM = 5
"""Half the thickness of a wall between rooms, centimetres."""


@dataclass(frozen=True)
class Rect:
    """An axis-aligned rectangle of the plan, whole centimetres."""

    x0: int
    z0: int
    x1: int
    z1: int

    @property
    def width_cm(self) -> int:
        """Extent along x."""
        return self.x1 - self.x0

    @property
    def depth_cm(self) -> int:
        """Extent along z."""
        return self.z1 - self.z0

    @property
    def area_m2(self) -> float:
        """Area, square metres."""
        return self.width_cm * self.depth_cm / 1e4

    @property
    def corners_cm(self) -> NDArray[np.int64]:
        """(4, 2) int64 corners (x, z) in order."""
        return np.array([[self.x0, self.z0], [self.x1, self.z0], [self.x1, self.z1], [self.x0, self.z1]])


@dataclass(frozen=True)
class Room:
    """A room: one rectangle, or two that make an L, between wall centre lines."""

    kind: str
    """One of `tiers.ROOM_TYPES`, or ``corridor``."""
    rects: tuple[Rect, ...]
    """Rectangles that touch and do not overlap, the largest first."""
    ceiling_cm: int
    """Height of the ceiling, centimetres."""

    @property
    def is_corridor(self) -> bool:
        """Whether the room only leads to others."""
        return self.kind == CORRIDOR

    @property
    def area_m2(self) -> float:
        """Floor area between wall centre lines, square metres."""
        return sum(rect.area_m2 for rect in self.rects)


@dataclass(frozen=True)
class Wall:
    """A straight piece of wall with the same two rooms along its whole length."""

    along_x: bool
    """Whether it runs along x (then `line_cm` is a z) or along z (then an x)."""
    line_cm: int
    """Coordinate of the centre line."""
    low_cm: int
    """Where it begins along its direction."""
    high_cm: int
    """Where it ends along its direction."""
    rooms: tuple[int, int]
    """Index of the room on the lower and on the higher side; `OUTSIDE` for none."""

    @property
    def length_cm(self) -> int:
        """Length, centimetres."""
        return self.high_cm - self.low_cm

    @property
    def is_exterior(self) -> bool:
        """Whether one side is outside."""
        return OUTSIDE in self.rooms

    @property
    def half_cm(self) -> int:
        """Half its thickness, centimetres."""
        return EXTERIOR_HALF_CM if self.is_exterior else INTERIOR_HALF_CM

    def solid_cm(self) -> Rect:
        """Footprint of the wall; ends are lengthened so that walls meet in full corners."""
        return band(
            self.along_x, self.line_cm, self.half_cm, self.low_cm - self.half_cm, self.high_cm + self.half_cm
        )


@dataclass(frozen=True)
class Opening:
    """A door, a wide opening, a window or the closed entrance in a wall."""

    kind: str
    """``door``, ``wide``, ``window`` or ``entrance``; only the first two lead somewhere."""
    wall: Wall
    """The wall it is cut into."""
    low_cm: int
    """Where it begins along the wall."""
    high_cm: int
    """Where it ends along the wall."""
    bottom_cm: int
    """Height of its lower edge; 0 for doors."""
    top_cm: int
    """Height of its lintel."""

    @property
    def width_m(self) -> float:
        """Clear width, metres."""
        return (self.high_cm - self.low_cm) / 100.0

    @property
    def height_m(self) -> float:
        """Clear height, metres."""
        return (self.top_cm - self.bottom_cm) / 100.0

    @property
    def rooms(self) -> tuple[int, int]:
        """Indices of the two rooms."""
        return self.wall.rooms

    @property
    def center_cm(self) -> tuple[float, float]:
        """Centre (x, z) on the wall's centre line, plan frame."""
        middle = (self.low_cm + self.high_cm) / 2.0
        return (middle, float(self.wall.line_cm)) if self.wall.along_x else (float(self.wall.line_cm), middle)

    @property
    def inward(self) -> int:
        """Side of the (first) room: -1 the lower one, +1 the higher one."""
        return -1 if self.wall.rooms[0] != OUTSIDE else 1


@dataclass(frozen=True)
class Layout:
    """The plan of a home: rooms, walls, doors and windows, and how it lies in the world."""

    tier: str
    """Name of the tier."""
    seed: int
    """Seed of the home."""
    yaw_rad: float
    """Turn of the plan in the world, counter-clockwise about +y."""
    rooms: tuple[Room, ...]
    """All rooms, corridors included."""
    walls: tuple[Wall, ...]
    """All walls."""
    doors: tuple[Opening, ...]
    """Passages between rooms: kinds ``door`` and ``wide``."""
    windows: tuple[Opening, ...]
    """Closed openings to the outside: kinds ``window`` and ``entrance``."""

    @property
    def area_m2(self) -> float:
        """Floor area between wall centre lines, square metres."""
        return sum(room.area_m2 for room in self.rooms)

    @property
    def num_rooms(self) -> int:
        """Rooms that are not corridors."""
        return sum(not room.is_corridor for room in self.rooms)

    @property
    def num_loops(self) -> int:
        """Independent cycles of the connected room graph (doors beyond a tree)."""
        return len({door.rooms for door in self.doors}) - len(self.rooms) + 1

    @property
    def ceiling_m(self) -> float:
        """Highest ceiling, metres."""
        return max(room.ceiling_cm for room in self.rooms) / 100.0

    @cached_property
    def center_cm(self) -> tuple[float, float]:
        """Centre of the plan's bounding rectangle; it lies at the world's origin."""
        corners = np.concatenate([rect.corners_cm for room in self.rooms for rect in room.rects])
        x, z = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
        return float(x), float(z)

    def world_xz(self, plan_cm: ArrayLike) -> NDArray[np.float64]:
        """Bring plan points (*, 2), centimetres, to world (x, z), metres."""
        x, z = np.moveaxis((np.asarray(plan_cm, np.float64) - self.center_cm) / 100.0, -1, 0)
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        return np.stack([cos * x + sin * z, cos * z - sin * x], axis=-1)

    def door_centers_xz(self) -> NDArray[np.float64]:
        """(D, 2) float64 centres of the doors, metres, world frame."""
        return self.world_xz(np.array([door.center_cm for door in self.doors]).reshape(-1, 2))

    def door_directions_xz(self) -> NDArray[np.float64]:
        """(D, 2) float64 unit vectors from the first room of each door to its second, world frame."""
        steps = np.array([(0.0, 1.0) if door.wall.along_x else (1.0, 0.0) for door in self.doors]).reshape(
            -1, 2
        )
        return (self.world_xz(100.0 * steps) - self.world_xz(np.zeros(2))).reshape(-1, 2)

    def room_polygons_xz(self, index: int) -> tuple[NDArray[np.float64], ...]:
        """Rectangles of a room as (4, 2) float64 polygons, metres, world frame."""
        return tuple(self.world_xz(rect.corners_cm) for rect in self.rooms[index].rects)

    def room_center_xz(self, index: int) -> NDArray[np.float64]:
        """(2,) float64 centre of a room's largest rectangle, metres, world frame."""
        return np.asarray(self.world_xz(self.rooms[index].rects[0].corners_cm).mean(axis=0))

    def walls_of(self, index: int) -> Iterable[tuple[Wall, int]]:
        """Walls of a room, each with the side (-1 or +1) of the wall on which the room lies."""
        for wall in self.walls:
            if index in wall.rooms:
                yield wall, -1 if wall.rooms[0] == index else 1


def band(along_x: bool, line_cm: int, half_cm: int, low_cm: int, high_cm: int) -> Rect:
    """Rectangle around a stretch of a line, `half_cm` to both sides."""
    if along_x:
        return Rect(low_cm, line_cm - half_cm, high_cm, line_cm + half_cm)
    return Rect(line_cm - half_cm, low_cm, line_cm + half_cm, high_cm)
