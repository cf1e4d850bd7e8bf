"""The floor of one room as a raster: what is taken, what must stay clear, and whether one can still walk.

This is how reachability is guaranteed by construction: a piece stays only if all doors of the room
remain connected for a body wider than any agent's.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from anm_gym.scenes.procedural.plan import Layout, Opening, Rect, band

CELL_M = 0.05
"""Edge of a cell, metres."""
WALKWAY_HALF_M = 0.31
"""Half the width of the way that always stays free, metres; above any body plus the errors of two rasters."""
_BORDER_CM = 70
_DOOR_ZONE_CM = 70
_WINDOW_ZONE_CM = 40
_POCKET_M2 = 0.4
_LEAST_WALKABLE = 0.3

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Pose:
    """Where a piece stands in the plan frame, metres; its front looks along (sin, cos) of the angle."""

    x_m: float
    z_m: float
    angle_rad: float


class RoomFloor:
    """Raster of one room; all arrays are (rows along z, columns along x)."""

    def __init__(self, layout: Layout, index: int) -> None:
        rects = layout.rooms[index].rects
        x0, z0 = (min(values) - _BORDER_CM for values in ([r.x0 for r in rects], [r.z0 for r in rects]))
        x1, z1 = (max(values) + _BORDER_CM for values in ([r.x1 for r in rects], [r.z1 for r in rects]))
        columns, rows = round((x1 - x0) / 100 / CELL_M), round((z1 - z0) / 100 / CELL_M)
        self._x = x0 / 100.0 + (np.arange(columns) + 0.5) * CELL_M
        self._z = z0 / 100.0 + (np.arange(rows) + 0.5) * CELL_M
        doors = [door for door in layout.doors if index in door.rooms]
        self.inside = self._union(rects) & ~self._union(
            [wall.solid_cm() for wall, _ in layout.walls_of(index)]
        )
        self.taken = np.zeros_like(self.inside)
        self.tall = np.zeros_like(self.inside)
        self.reserved = self._union([_zone(door, _DOOR_ZONE_CM) for door in doors])
        entrances = [o for o in layout.windows if index in o.rooms and o.kind == "entrance"]
        self.reserved |= self._union([_zone(opening, _DOOR_ZONE_CM) for opening in entrances])
        self.windows = self._union([_zone(o, _WINDOW_ZONE_CM) for o in layout.windows if index in o.rooms])
        self._open = self.inside | self._union([_zone(door, _BORDER_CM - 10, 0) for door in doors])
        self._gates = [self._cell_of(*door.center_cm) for door in doors]
        self._walkable_at_first = max(1, int((self._walkable(self.taken) & self.inside).sum()))

    def try_take(self, footprints: NDArray[np.float64], pose: Pose, front_m: float, is_tall: bool) -> bool:
        """Take the floor under a piece, if it is free and if all doors stay connected without it.

        Args:
            footprints: (K, 4) float64 rectangles of the piece in its own frame, metres.
            pose: Where it would stand.
            front_m: Depth before the first rectangle that no later piece may take, metres.
            is_tall: Whether it would cover a window.
        """
        body = self.covered(footprints, pose)
        blocked = ~self.inside | self.taken | self.reserved
        if (body & (blocked | self.windows if is_tall else blocked)).any():
            return False
        front = self._front(footprints, pose, front_m)
        if (front & (self.taken | ~self._open)).any() or not self._stays_walkable(self.taken | body):
            return False
        self.taken |= body
        self.reserved |= front
        if is_tall:
            self.tall |= body
        return True

    def try_take_fixture(self, footprints: NDArray[np.float64], pose: Pose) -> bool:
        """Take the floor under a part of the building, which may stand in the zones of doors and windows."""
        body = self.covered(footprints, pose)
        if (body & self.taken).any() or not self._stays_walkable(self.taken | body):
            return False
        self.taken |= body
        return True

    def obstruct(self, footprints: NDArray[np.float64], pose: Pose) -> None:
        """Mark what stands in the way but does not keep low furniture from standing under it."""
        self._open &= ~self.covered(footprints, pose)

    def has_free_wall(self, low_m: float, high_m: float, pose: Pose) -> bool:
        """Whether a stretch of wall, in the frame of a piece at `pose`, is bare above low furniture."""
        strip = self.covered(np.array([[low_m, 0.01, high_m, 0.11]]), pose)
        return not (strip & (~self.inside | self.tall | self.windows | self.reserved)).any()

    def roomiest(self) -> tuple[float, float]:
        """Plan position (x, z), metres, with the most free floor around it."""
        distance = ndimage.distance_transform_edt(self.inside & ~self.taken & ~self.reserved)
        row, column = np.unravel_index(int(np.argmax(distance)), distance.shape)
        return float(self._x[column]), float(self._z[row])

    def free_position(self, rng: np.random.Generator) -> tuple[float, float]:
        """Random plan position (x, z), metres, on the free floor, or on any floor if none is free."""
        free = self.inside & ~self.taken & ~self.reserved
        cells = np.argwhere(free if free.any() else self.inside)
        row, column = cells[int(rng.integers(len(cells)))]
        return float(self._x[column]), float(self._z[row])

    def covered(self, footprints: NDArray[np.float64], pose: Pose, margin_m: float = 0.01) -> Mask:
        """Cells whose centre lies in one of the rectangles of a piece."""
        cos, sin = np.cos(pose.angle_rad), np.sin(pose.angle_rad)
        dx, dz = (self._x - pose.x_m)[None, :], (self._z - pose.z_m)[:, None]
        x, z = cos * dx - sin * dz, sin * dx + cos * dz
        mask = np.zeros_like(self.inside)
        for x0, z0, x1, z1 in footprints:
            mask |= (x > x0 - margin_m) & (x < x1 + margin_m) & (z > z0 - margin_m) & (z < z1 + margin_m)
        return mask

    def _front(self, footprints: NDArray[np.float64], pose: Pose, depth_m: float) -> Mask:
        if depth_m == 0.0 or len(footprints) == 0:
            return np.zeros_like(self.inside)
        x0, _, x1, z1 = footprints[0]
        return self.covered(np.array([[x0 + 0.05, z1 + 0.04, x1 - 0.05, z1 + depth_m]]), pose)

    def _stays_walkable(self, taken: Mask) -> bool:
        """All doors in one connected part, no large pocket beside it, and enough of the floor left."""
        walkable = self._walkable(taken)
        labels, count = ndimage.label(walkable)
        sizes = np.bincount(labels.ravel(), minlength=count + 1)[1:]
        if count == 0:
            return False
        main = 1 + int(np.argmax(sizes))
        if any(labels[gate] != main for gate in self._gates):
            return False
        pockets = np.delete(sizes, main - 1) * CELL_M**2
        enough = ((labels == main) & self.inside).sum() >= _LEAST_WALKABLE * self._walkable_at_first
        return bool(enough and (pockets < _POCKET_M2).all())

    def _walkable(self, taken: Mask) -> Mask:
        distance = ndimage.distance_transform_edt(self._open & ~taken)
        return np.asarray(CELL_M * distance > WALKWAY_HALF_M)

    def _union(self, rects: list[Rect] | tuple[Rect, ...]) -> Mask:
        mask = np.zeros((len(self._z), len(self._x)), bool)
        for rect in rects:
            columns = (self._x > rect.x0 / 100.0) & (self._x < rect.x1 / 100.0)
            rows = (self._z > rect.z0 / 100.0) & (self._z < rect.z1 / 100.0)
            mask |= rows[:, None] & columns[None, :]
        return mask

    def _cell_of(self, x_cm: float, z_cm: float) -> tuple[int, int]:
        row = int(np.argmin(np.abs(self._z - z_cm / 100.0)))
        return row, int(np.argmin(np.abs(self._x - x_cm / 100.0)))


def _zone(opening: Opening, depth_cm: int, side_cm: int = 5) -> Rect:
    """Floor to both sides of an opening."""
    wall = opening.wall
    return band(
        wall.along_x,
        wall.line_cm,
        depth_cm + wall.half_cm,
        opening.low_cm - side_cm,
        opening.high_cm + side_cm,
    )
