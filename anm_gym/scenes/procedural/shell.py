"""The bare home as one closed surface: floors, walls, ceilings, door passages and window recesses.

Everything that is not air is solid. The air (rooms, passages, recesses) is drawn into a grid whose
lines are all the coordinates of the plan; the faces between air and solid are merged to rectangles,
and neighbours share every vertex on their edges, so that no ray finds a gap.
"""

from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from anm_gym.scenes.procedural.palette import GLASS, RGB, WHITE, RoomColors, shade
from anm_gym.scenes.procedural.plan import OUTSIDE, Layout, Opening, Rect, band
from anm_gym.scenes.procedural.primitives import Solid

_SKIRTING_CM = 8
_PANE_CM = 4
_SOLID = -1
_TRIM: RGB = (226, 220, 208)
_ENTRANCE: RGB = (116, 78, 56)
_DIRECTIONS = ((0, -1), (0, 1), (1, -1), (1, 1), (2, -1), (2, 1))
"""Axis and sign under which a face is looked up: where the solid lies as seen from the air."""


@dataclass(frozen=True)
class _Grid:
    """Labels of the boxes between all coordinates of the plan."""

    lines: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]
    """Coordinates along x, y and z, centimetres."""
    labels: NDArray[np.int64]
    """(X, Y, Z) int64: index of the room, or number of rooms + index of the opening, or `_SOLID`."""

    def fill(self, rect: Rect, low_y: int, high_y: int, label: int) -> None:
        """Label all boxes inside a rectangle between two heights."""
        self.labels[
            self.span(0, rect.x0, rect.x1), self.span(1, low_y, high_y), self.span(2, rect.z0, rect.z1)
        ] = label

    def span(self, axis: int, low: int, high: int) -> slice:
        first, last = np.searchsorted(self.lines[axis], (low, high))
        return slice(int(first), int(last))


@dataclass(frozen=True)
class _Face:
    """A rectangle of one colour; `low` and `high` are its two coordinates in the plane."""

    axis: int
    sign: int
    at: int
    low: tuple[int, int]
    high: tuple[int, int]
    color: int


def build_shell(layout: Layout, colors: tuple[RoomColors, ...]) -> Solid:
    """Build the bare home in the plan frame.

    Args:
        layout: The plan.
        colors: Colours of each room.

    Returns:
        A watertight surface in metres, plan frame, whose normals point into the air.
    """
    grid = _draw_air(layout)
    table = _color_table(layout, colors, grid)
    faces = [face for direction in range(6) for face in _faces_towards(grid, table, direction)]
    return _triangulate(faces)


def recess_cm(opening: Opening) -> Rect:
    """Footprint of the air in an opening: through the wall, or up to the pane of a closed one."""
    wall = opening.wall
    if OUTSIDE not in wall.rooms:
        return band(wall.along_x, wall.line_cm, wall.half_cm, opening.low_cm, opening.high_cm)
    ends = (wall.line_cm + opening.inward * wall.half_cm, wall.line_cm - opening.inward * _PANE_CM)
    low, high = min(ends), max(ends)
    if wall.along_x:
        return Rect(opening.low_cm, low, opening.high_cm, high)
    return Rect(low, opening.low_cm, high, opening.high_cm)


def _draw_air(layout: Layout) -> _Grid:
    openings = layout.doors + layout.windows
    rects = [rect for room in layout.rooms for rect in room.rects]
    rects += [wall.solid_cm() for wall in layout.walls] + [recess_cm(opening) for opening in openings]
    heights = {0, _SKIRTING_CM, *(room.ceiling_cm for room in layout.rooms)}
    heights |= {height for opening in openings for height in (opening.bottom_cm, opening.top_cm)}
    xs = np.unique([x for rect in rects for x in (rect.x0, rect.x1)])
    zs = np.unique([z for rect in rects for z in (rect.z0, rect.z1)])
    ys = np.array(sorted(heights))
    grid = _Grid((xs, ys, zs), np.full((len(xs) - 1, len(ys) - 1, len(zs) - 1), _SOLID))
    for index, room in enumerate(layout.rooms):
        for rect in room.rects:
            grid.fill(rect, 0, room.ceiling_cm, index)
    for wall in layout.walls:
        grid.fill(wall.solid_cm(), 0, int(ys[-1]), _SOLID)
    for index, opening in enumerate(openings, len(layout.rooms)):
        grid.fill(recess_cm(opening), opening.bottom_cm, opening.top_cm, index)
    return grid


def _color_table(layout: Layout, colors: tuple[RoomColors, ...], grid: _Grid) -> NDArray[np.int64]:
    """(labels, 6 directions, Y) int64 packed colour + 1 of a face of an air box."""
    openings = layout.doors + layout.windows
    table = np.zeros((len(layout.rooms) + len(openings), 6, len(grid.lines[1]) - 1), np.int64)
    for index, color in enumerate(colors):
        table[index, 2], table[index, 3] = _pack(color.floor), _pack(color.ceiling)
        table[index, (0, 1, 4, 5)] = _pack(color.wall)
        table[index, (0, 1, 4, 5), : grid.span(1, 0, _SKIRTING_CM).stop] = _pack(shade(color.wall, 1.12))
    for index, opening in enumerate(openings, len(layout.rooms)):
        table[index] = _pack(_TRIM if opening.bottom_cm == 0 else WHITE)
        outward = (4 if opening.wall.along_x else 0) + (opening.inward < 0)
        if opening in layout.windows:
            table[index, outward] = _pack(GLASS if opening.kind == "window" else _ENTRANCE)
        else:
            table[index, 2] = _pack(shade(colors[opening.rooms[0]].floor, 0.85))
    return table


def _pack(color: RGB) -> int:
    red, green, blue = color
    return 1 + (red << 16 | green << 8 | blue)


def _faces_towards(grid: _Grid, table: NDArray[np.int64], direction: int) -> list[_Face]:
    """All faces of air boxes whose solid neighbour lies in one direction."""
    axis, sign = _DIRECTIONS[direction]
    padded = np.pad(grid.labels, 1, constant_values=_SOLID)
    neighbour = np.roll(padded, -sign, axis)[1:-1, 1:-1, 1:-1]
    colors = table[grid.labels, direction, np.arange(grid.labels.shape[1])[None, :, None]]
    keys = np.moveaxis(np.where((grid.labels != _SOLID) & (neighbour == _SOLID), colors, 0), axis, 0)
    first, second = (line for index, line in enumerate(grid.lines) if index != axis)
    faces = []
    for index in np.flatnonzero(keys.any(axis=(1, 2))):
        at = int(grid.lines[axis][index + (sign > 0)])
        for r0, r1, c0, c1, color in _merge(keys[index]):
            low, high = (int(first[r0]), int(second[c0])), (int(first[r1]), int(second[c1]))
            faces.append(_Face(axis, sign, at, low, high, color))
    return faces


def _merge(keys: NDArray[np.int64]) -> list[tuple[int, int, int, int, int]]:
    """Cover equal non-zero keys by rectangles (row, row end, column, column end, key)."""
    done = []
    growing: dict[tuple[int, int, int], int] = {}
    for row, runs in enumerate([*_runs_by_row(keys), []]):
        ended = growing.keys() - set(runs)
        done += [(growing[run], row, *run) for run in sorted(ended)]
        growing = {run: growing.get(run, row) for run in runs}
    return done


def _runs_by_row(keys: NDArray[np.int64]) -> list[list[tuple[int, int, int]]]:
    """Runs (column, column end, key) of equal non-zero keys of each row."""
    runs: list[list[tuple[int, int, int]]] = [[] for _ in keys]
    rows, columns = np.nonzero(np.diff(keys, axis=1, prepend=0, append=0))
    edges = list(zip(rows.tolist(), columns.tolist(), strict=True))
    for (row, start), (next_row, stop) in pairwise(edges):
        if row == next_row and keys[row, start]:
            runs[row].append((start, stop, int(keys[row, start])))
    return runs


def _triangulate(faces: list[_Face]) -> Solid:
    """Triangles of all faces; each face has a vertex wherever a neighbour has one on its edge."""
    corners = {corner for face in faces for corner in _corners(face)}
    on_line: dict[tuple[int, int, int], list[int]] = {}
    for corner in corners:
        for axis in range(3):
            on_line.setdefault(_line(corner, axis), []).append(corner[axis])
    for positions in on_line.values():
        positions.sort()
    points: dict[tuple[float, ...], int] = {}
    triangles: list[tuple[int, int, int]] = []
    colors: list[int] = []
    for face in faces:
        ring = [points.setdefault(point, len(points)) for point in _ring(face, on_line)]
        added = _fan(ring, face, points)
        triangles += added
        colors += [face.color - 1] * len(added)
    packed = np.array(colors)
    rgb = np.stack([packed >> 16, packed >> 8 & 255, packed & 255], axis=1).astype(np.uint8)
    return Solid(np.array(list(points), np.float64) / 100.0, np.array(triangles, np.int32), rgb)


def _corners(face: _Face) -> list[tuple[int, int, int]]:
    """Corners of a face, counter-clockwise as seen from the air."""
    (a0, b0), (a1, b1) = face.low, face.high
    flat = [(a0, b0), (a1, b0), (a1, b1), (a0, b1)]
    if (face.sign < 0) == (face.axis == 1):
        flat.reverse()
    return [(*pair[: face.axis], face.at, *pair[face.axis :]) for pair in flat]  # type: ignore[misc]


def _line(point: tuple[int, int, int], axis: int) -> tuple[int, int, int]:
    """Name of the line through a point along an axis."""
    first, second = (value for index, value in enumerate(point) if index != axis)
    return axis, first, second


def _ring(face: _Face, on_line: dict[tuple[int, int, int], list[int]]) -> list[tuple[int, ...]]:
    """Outline of a face with every vertex that lies on it."""
    corners = _corners(face)
    ring: list[tuple[int, ...]] = []
    for start, stop in zip(corners, corners[1:] + corners[:1], strict=True):
        axis = next(index for index in range(3) if start[index] != stop[index])
        positions = on_line[_line(start, axis)]
        low, high = sorted((start[axis], stop[axis]))
        between = positions[bisect_right(positions, low) : bisect_left(positions, high)]
        ordered = between if start[axis] < stop[axis] else between[::-1]
        ring += [start, *((*start[:axis], value, *start[axis + 1 :]) for value in ordered)]
    return ring


def _fan(ring: list[int], face: _Face, points: dict[tuple[float, ...], int]) -> list[tuple[int, int, int]]:
    """Two triangles for a plain rectangle, else a fan around its centre."""
    if len(ring) == 4:
        a, b, c, d = ring
        return [(a, b, c), (a, c, d)]
    middle = [(low + high) / 2.0 for low, high in zip(face.low, face.high, strict=True)]
    middle.insert(face.axis, float(face.at))
    center = points.setdefault(tuple(middle), len(points))
    return [(center, start, stop) for start, stop in zip(ring, ring[1:] + ring[:1], strict=True)]
