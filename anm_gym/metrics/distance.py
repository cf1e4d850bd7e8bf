"""Exact distance from points to a triangle mesh, in vectorised numpy.

Triangles are cut into small pieces and sorted by size; a piece with centre c and radius r lies at a distance
of at least |p - c| - r from a point p, so the nearest centres bound which pieces can be nearest.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from anm_gym.mesh import TriangleMesh

_PIECES: Final = 40_000
_MIN_RADIUS_M: Final = 0.01
_PAIRS_PER_CHUNK: Final = 1_000_000
_CLASS_RATIO: Final = 2.5
_NUM_CLASSES: Final = 5


class MeshDistance:
    """Unsigned distance to the surface of a mesh.

    Example:
        >>> floor = TriangleMesh(
        ...     np.array([[-1.0, 0, -1], [1, 0, -1], [0, 0, 1]]), np.array([[0, 1, 2]], np.int32)
        ... )
        >>> MeshDistance(floor).distance_m(np.array([[0.0, 0.25, 0.0]])).tolist()
        [0.25]
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        """Cut the triangles and index their pieces.

        Args:
            mesh: The surface.
        """
        radius_m = max(_MIN_RADIUS_M, float(np.sqrt(2.0 * mesh.areas_m2.sum() / _PIECES)))
        pieces = cut_triangles(mesh.triangles, radius_m)
        size_class = np.floor(np.log(np.maximum(_radii_m(pieces), 1e-9) / radius_m) / np.log(_CLASS_RATIO))
        size_class = np.maximum(size_class, 1 - _NUM_CLASSES)
        self._classes = [_PieceTree(pieces[size_class == k]) for k in np.unique(size_class)[::-1]]

    def distance_m(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Distance of points to the nearest point of any triangle.

        Args:
            points: (N, 3), metres, world frame.

        Returns:
            (N,) float64 metres, exact but for rounding.

        Raises:
            ValueError: If `points` has another shape.
        """
        if points.ndim != 2 or points.shape[1] != 3:
            raise ValueError(f"`points` must have shape (N, 3), got {points.shape}")
        queries = np.asarray(points, np.float64)
        best = np.full(len(queries), np.inf)
        for pieces in self._classes:
            pieces.improve(queries, best)
        return best


class _PieceTree:
    """Pieces of about one size, so that one radius bounds them all tightly."""

    def __init__(self, pieces: NDArray[np.float64]) -> None:
        self._pieces = pieces
        self._radii_m = _radii_m(pieces)
        self._radius_m = float(self._radii_m.max())
        self._tree = cKDTree(pieces.mean(axis=1), balanced_tree=False, compact_nodes=False)

    def improve(self, points: NDArray[np.float64], best: NDArray[np.float64]) -> None:
        """Lower `best` (N,) in place to the distance to these pieces where that is less."""
        index, tried, count = np.arange(len(points)), 0, 1
        while len(index) and tried < len(self._pieces):
            size = max(1, _PAIRS_PER_CHUNK // count)
            chunks = [index[start : start + size] for start in range(0, len(index), size)]
            index = np.concatenate([self._refine(points, best, chunk, tried, count) for chunk in chunks])
            tried, count = count, min(4 * count, len(self._pieces))

    def _refine(
        self,
        points: NDArray[np.float64],
        best: NDArray[np.float64],
        index: NDArray[np.int64],
        tried: int,
        count: int,
    ) -> NDArray[np.int64]:
        """Try the neighbours after `tried` up to `count`; hand back points that may have a nearer one."""
        to_center, pieces = self._tree.query(points[index], k=np.arange(tried + 1, count + 1))
        row, column = np.nonzero(to_center - self._radii_m[pieces] < best[index, None])
        distance = point_triangle_distance(points[index[row]], self._pieces[pieces[row, column]])
        np.minimum.at(best, index[row], distance)
        return np.asarray(index[to_center[:, -1] - self._radius_m < best[index]])


def cut_triangles(triangles: NDArray[np.float64], radius_m: float) -> NDArray[np.float64]:
    """Halve the longest edge of triangles until every corner is near the centroid.

    Args:
        triangles: (F, 3, 3) corners, metres.
        radius_m: Largest distance of a corner from its centroid, metres.

    Returns:
        (G, 3, 3) triangles that cover the same surface.
    """
    done = []
    while len(triangles):
        is_small = _radii_m(triangles) <= radius_m
        done.append(triangles[is_small])
        triangles = _halved(triangles[~is_small])
    return np.concatenate(done)


def _halved(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    edges = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
    turn = (edges.argmax(axis=1)[:, None] + np.arange(3)) % 3
    first, second, third = np.take_along_axis(triangles, turn[:, :, None], axis=1).transpose(1, 0, 2)
    middle = 0.5 * (first + second)
    return np.concatenate(
        [np.stack([first, middle, third], axis=1), np.stack([middle, second, third], axis=1)]
    )


def _radii_m(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    offsets = triangles - triangles.mean(axis=1, keepdims=True)
    return np.asarray(np.linalg.norm(offsets, axis=2).max(axis=1))


def point_triangle_distance(
    points: NDArray[np.float64], triangles: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distance of each point to its own triangle.

    The nearest point lies on the plane where the projection falls inside, else on an edge.

    Args:
        points: (N, 3) metres.
        triangles: (N, 3, 3) corners, metres; a degenerate triangle is the segment or point that it is.

    Returns:
        (N,) float64 metres.
    """
    corners = triangles.transpose(1, 0, 2)
    edges = np.roll(corners, -1, axis=0) - corners
    offsets = points - corners
    normal = np.cross(edges[0], edges[1])
    normal_squared = np.einsum("nd,nd->n", normal, normal)
    sides = np.einsum("knd,nd->kn", np.cross(edges, offsets), normal)
    is_over = (sides >= 0.0).all(axis=0) & (normal_squared > 0.0)
    length_squared = np.einsum("knd,knd->kn", edges, edges)
    along = np.einsum("knd,knd->kn", offsets, edges)
    share = np.clip(along / np.where(length_squared > 0.0, length_squared, 1.0), 0.0, 1.0)
    to_edges = np.linalg.norm(offsets - share[:, :, None] * edges, axis=2).min(axis=0)
    height = np.abs(np.einsum("nd,nd->n", offsets[0], normal))
    to_plane = height / np.sqrt(np.where(normal_squared > 0.0, normal_squared, 1.0))
    return np.asarray(np.where(is_over, to_plane, to_edges))
