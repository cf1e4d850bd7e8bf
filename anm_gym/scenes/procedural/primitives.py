"""Closed coloured solids and the few ways to make them: boxes, turned profiles, extrusions, cushions, tubes.

Every piece of furniture is a `Solid` made here; nothing in this module knows about rooms.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.scenes.procedural.palette import RGB

Point = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Solid:
    """Triangles with a colour each, metres, y up."""

    vertices: NDArray[np.float64]
    """(V, 3) float64."""
    faces: NDArray[np.int32]
    """(F, 3) int32, counter-clockwise as seen from the air."""
    colors: NDArray[np.uint8]
    """(F, 3) uint8 RGB."""

    @property
    def low(self) -> NDArray[np.float64]:
        """(3,) lowest corner."""
        return np.asarray(self.vertices.min(axis=0))

    @property
    def high(self) -> NDArray[np.float64]:
        """(3,) highest corner."""
        return np.asarray(self.vertices.max(axis=0))

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> "Solid":
        """Shift."""
        return Solid(self.vertices + np.array((x, y, z)), self.faces, self.colors)

    def turned(self, angle_rad: float, axis: str = "y") -> "Solid":
        """Turn counter-clockwise about a world axis through the origin."""
        first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
        cos, sin = np.cos(angle_rad), np.sin(angle_rad)
        vertices = self.vertices.copy()
        vertices[:, first] = cos * self.vertices[:, first] - sin * self.vertices[:, second]
        vertices[:, second] = sin * self.vertices[:, first] + cos * self.vertices[:, second]
        return Solid(vertices, self.faces, self.colors)

    def cut_off_below(self, height_m: float) -> "Solid":
        """Press what reaches below a height flat on it: the feet of slanted legs."""
        vertices = self.vertices.copy()
        vertices[:, 1] = np.maximum(vertices[:, 1], height_m)
        return Solid(vertices, self.faces, self.colors)

    def without_faces_on(self, height_m: float) -> "Solid":
        """Leave out the faces that lie flat on a height: nobody sees the bottom of a sofa on the floor."""
        flat = (np.abs(self.vertices[self.faces][:, :, 1] - height_m) < 1e-4).all(axis=1)
        return Solid(self.vertices, self.faces[~flat], self.colors[~flat])


def join(solids: Iterable[Solid]) -> Solid:
    """Put solids into one, without welding them."""
    parts = list(solids)
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    return Solid(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]).astype(
            np.int32
        ),
        np.concatenate([part.colors for part in parts]),
    )


def box(low: ArrayLike, high: ArrayLike, color: RGB) -> Solid:
    """Axis-aligned box between two corners."""
    (x0, y0, z0), (x1, y1, z1) = np.asarray(low, np.float64), np.asarray(high, np.float64)
    return extrude([(x0, z0), (x1, z0), (x1, z1), (x0, z1)], y0, y1, color)


def block(width: float, height: float, depth: float, color: RGB, at: Point = (0.0, 0.0, 0.0)) -> Solid:
    """Box whose bottom is centred at a point."""
    x, y, z = at
    return box((x - width / 2, y, z - depth / 2), (x + width / 2, y + height, z + depth / 2), color)


def extrude(outline_xz: ArrayLike, bottom: float, top: float, color: RGB) -> Solid:
    """Prism over a convex outline (N, 2), given counter-clockwise in (x, z)."""
    outline = np.asarray(outline_xz, np.float64)
    count = len(outline)
    rings = [np.insert(outline, 1, height, axis=1) for height in (bottom, top)]
    ahead = (np.arange(count) + 1) % count
    around = np.arange(count)
    inner = np.arange(1, count - 1)
    zero = np.zeros_like(inner)
    faces = np.concatenate(
        [
            np.stack([zero, inner, inner + 1], axis=1),
            np.stack([zero, inner + 1, inner], axis=1) + count,
            np.stack([around, around + count, ahead], axis=1),
            np.stack([ahead, around + count, ahead + count], axis=1),
        ]
    )
    return _paint(np.concatenate(rings), faces, color)


def rounded(width: float, height: float, depth: float, radius: float, color: RGB, steps: int = 3) -> Solid:
    """Box with rounded vertical edges, centred over the origin and standing on it."""
    radius = min(radius, 0.499 * width, 0.499 * depth)
    angles = np.linspace(0.0, np.pi / 2, steps + 1)
    arc = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    center = np.array([width / 2 - radius, depth / 2 - radius])
    quarter = arc + center
    outline = np.concatenate(
        [quarter, (quarter * (-1, 1))[::-1], quarter * (-1, -1), (quarter * (1, -1))[::-1]],
    )
    return extrude(outline, 0.0, height, color)


def lathe(profile: Sequence[tuple[float, float]], color: RGB, segments: int = 12) -> Solid:
    """Turn a profile of (radius, height) about the y axis; it may begin and end off the axis.

    A profile that rises has its outside facing away from the axis.
    """
    radii, heights = np.asarray(profile, np.float64).T
    angles = np.arange(segments) * (2.0 * np.pi / segments)
    x = radii[:, None] * np.cos(angles)
    z = -radii[:, None] * np.sin(angles)
    y = np.repeat(heights[:, None], segments, axis=1)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    faces = _tube_faces(len(radii), segments)
    poles = np.array([[0.0, heights[0], 0.0], [0.0, heights[-1], 0.0]])
    return _paint(np.concatenate([vertices, poles]), faces, color)


def _tube_faces(rings: int, segments: int) -> NDArray[np.int64]:
    """Faces of rings of vertices, closed by two fans around the two vertices that follow them."""
    around = np.arange(segments)
    ahead = (around + 1) % segments
    base = (np.arange(rings - 1) * segments)[:, None]
    here, there = base + around, base + ahead
    sides = [
        np.stack([here, there, there + segments], axis=-1).reshape(-1, 3),
        np.stack([here, there + segments, here + segments], axis=-1).reshape(-1, 3),
    ]
    last, pole = (rings - 1) * segments, rings * segments
    caps = [
        np.stack([np.full(segments, pole), ahead, around], axis=1),
        np.stack([np.full(segments, pole + 1), last + around, last + ahead], axis=1),
    ]
    return np.concatenate(sides + caps)


def cylinder(
    radius: float, height: float, color: RGB, segments: int = 12, top_radius: float | None = None
) -> Solid:
    """Upright cylinder or truncated cone standing on the origin."""
    return lathe([(radius, 0.0), (radius if top_radius is None else top_radius, height)], color, segments)


def cushion(size: Point, color: RGB, softness: float = 0.5, segments: int = 12, rings: int = 5) -> Solid:
    """Superellipsoid standing on the origin: an ellipsoid at softness 1, nearly a box near 0.

    Args:
        size: Width, height and depth, metres.
        color: Colour.
        softness: Exponent of the sine and cosine, in (0, 1].
        segments: Vertices around.
        rings: Vertices from bottom to top, without the poles.
    """
    latitude = np.linspace(-np.pi / 2, np.pi / 2, rings + 2)[1:-1, None]
    longitude = (np.arange(segments) + 0.5) * (2.0 * np.pi / segments)
    level = _soft(np.cos(latitude), softness)
    x = level * _soft(np.cos(longitude), softness)
    z = -level * _soft(np.sin(longitude), softness)
    y = np.broadcast_to(_soft(np.sin(latitude), softness), x.shape)
    vertices = np.concatenate(
        [np.stack([x, y, z], axis=-1).reshape(-1, 3), [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]]
    )
    half = np.asarray(size) / 2.0
    return _paint(vertices * half + (0.0, half[1], 0.0), _tube_faces(rings, segments), color)


def _soft(value: NDArray[np.float64], softness: float) -> NDArray[np.float64]:
    return np.asarray(np.sign(value) * np.abs(value) ** softness)


def ellipsoid(size: Point, color: RGB, segments: int = 12, rings: int = 5) -> Solid:
    """Ellipsoid of a width, height and depth standing on the origin."""
    return cushion(size, color, 1.0, segments, rings)


def tube(path: ArrayLike, radius: float, color: RGB, segments: int = 5) -> Solid:
    """Round bar along a path (N, 3) of at least two points."""
    points = np.asarray(path, np.float64)
    tangents = np.gradient(points, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    start = np.eye(3)[int(np.argmin(np.abs(tangents).max(axis=0)))]
    side = np.cross(start, tangents)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(tangents, side)
    angles = np.arange(segments) * (2.0 * np.pi / segments)
    offsets = np.cos(angles)[:, None] * side[:, None] + np.sin(angles)[:, None] * up[:, None]
    vertices = np.concatenate([(points[:, None] + radius * offsets).reshape(-1, 3), points[[0, -1]]])
    return _paint(vertices, _tube_faces(len(points), segments), color)


def bar(start: Point, stop: Point, radius: float, color: RGB, segments: int = 5) -> Solid:
    """Straight round bar between two points: a leg, a rail, a pole."""
    return tube([start, stop], radius, color, segments)


def wavy_sheet(width: float, height: float, color: RGB, waves: int = 3, amplitude: float = 0.03) -> Solid:
    """Curtain hanging from `height` to the ground: a closed sheet along x, folded along z."""
    count = 4 * waves + 1
    x = np.linspace(-width / 2, width / 2, count)
    z = amplitude * np.sin(np.linspace(0.0, 2.0 * np.pi * waves, count))
    zero = np.zeros(count)
    corners = [(zero, z), (zero + height, z), (zero + height, z + 0.015), (zero, z + 0.015)]
    sections = np.stack([np.stack([x, y, depth], axis=1) for y, depth in corners], axis=1)
    ends = sections[[0, -1]].mean(axis=1)
    return _paint(np.concatenate([sections.reshape(-1, 3), ends]), _tube_faces(count, 4), color)


def _paint(vertices: NDArray[np.float64], faces: NDArray[np.int64], color: RGB) -> Solid:
    return Solid(vertices, faces.astype(np.int32), np.tile(np.array(color, np.uint8), (len(faces), 1)))
