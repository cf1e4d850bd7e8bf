"""The predicted surface: marching cubes over a lattice that spans what was observed."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.measure import marching_cubes

SignedDistance = Callable[[NDArray[np.float32]], NDArray[np.float32]]
"""Maps (N, 3) points to (N,) signed distances, metres."""


@dataclass(frozen=True)
class Lattice:
    """A regular grid of points."""

    low: NDArray[np.float64]
    """(3,) lowest corner, metres, world frame."""
    spacing_m: NDArray[np.float64]
    """(3,) distance between neighbours along each axis, metres."""
    shape: tuple[int, int, int]
    """Points along each axis."""

    @classmethod
    def with_spacing(cls, bounds: NDArray[np.float64], spacing_m: float) -> "Lattice":
        """Span (2, 3) bounds with cubic cells."""
        counts = np.maximum(np.ceil((bounds[1] - bounds[0]) / spacing_m).astype(int) + 1, 2)
        return cls(bounds[0].copy(), np.full(3, spacing_m), (int(counts[0]), int(counts[1]), int(counts[2])))

    @classmethod
    def with_resolution(cls, bounds: NDArray[np.float64], resolution: int) -> "Lattice":
        """Span (2, 3) bounds with `resolution` points along each axis."""
        extent = np.maximum(bounds[1] - bounds[0], 1e-3)
        return cls(bounds[0].copy(), extent / (resolution - 1), (resolution, resolution, resolution))

    @property
    def axes(self) -> list[NDArray[np.float64]]:
        """Coordinates of the points along each axis, metres."""
        return [self.low[i] + self.spacing_m[i] * np.arange(self.shape[i]) for i in range(3)]

    @property
    def points(self) -> NDArray[np.float32]:
        """(N, 3) float32 grid points, last axis fastest."""
        return np.stack(np.meshgrid(*self.axes, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)

    def points_in(self, mask: NDArray[np.bool_]) -> NDArray[np.float32]:
        """(N, 3) float32 grid points in an (X, Y, Z) mask, last axis fastest."""
        indices = np.nonzero(mask)
        return np.stack([axis[index] for axis, index in zip(self.axes, indices, strict=True)], axis=1).astype(
            np.float32
        )

    def near(self, points: NDArray[np.floating], radius_m: float) -> NDArray[np.bool_]:
        """Find the grid points around others.

        Args:
            points: (N, 3) within the lattice, metres, world frame.
            radius_m: Distance up to which grid points count, metres.

        Returns:
            (X, Y, Z) bool: all grid points within the radius of one of the points, and none that is farther
            than that by more than a cell's diagonal.
        """
        is_empty = np.ones(self.shape, bool)
        nearest = np.rint((points - self.low) / self.spacing_m).astype(np.int64)
        is_empty[tuple(nearest.T)] = False
        half_diagonal_m = 0.5 * float(np.linalg.norm(self.spacing_m))
        to_points_m = ndimage.distance_transform_edt(is_empty, sampling=self.spacing_m)
        return np.asarray(to_points_m <= radius_m + half_diagonal_m)


@dataclass(frozen=True)
class ZeroCrossings:
    """A triangle mesh where the predicted distance is zero."""

    vertices: NDArray[np.float32]
    """(V, 3) float32, metres, world frame."""
    faces: NDArray[np.int32]
    """(F, 3) int32 indices into `vertices`, wound so that normals point into free space."""

    def __len__(self) -> int:
        return len(self.vertices)

    def keep_vertices(self, keep: NDArray[np.bool_], *, whole_faces: bool = True) -> "ZeroCrossings":
        """Keep the faces whose vertices all (or, if not `whole_faces`, any of whose vertices) are kept."""
        corners = keep[self.faces]
        faces = self.faces[corners.all(axis=1) if whole_faces else corners.any(axis=1)]
        used, compact = np.unique(faces, return_inverse=True)
        return ZeroCrossings(self.vertices[used], compact.reshape(-1, 3).astype(np.int32))


EMPTY = ZeroCrossings(np.empty((0, 3), np.float32), np.empty((0, 3), np.int32))


def extract_zero_crossings(
    sdf: SignedDistance, lattice: Lattice, mask: NDArray[np.bool_] | None = None
) -> ZeroCrossings:
    """Extract the zero level set of a signed distance by marching cubes.

    Args:
        sdf: Evaluated once at every lattice point.
        lattice: Where to look; it comes from observations, never from the true mesh.
        mask: (X, Y, Z) lattice points that matter; None takes all.

    Returns:
        The zero-crossings; empty if the sign never changes.

    Source:
        Active Neural Mapping, Sec. 4.2 (zero-crossing samples).
    """
    values = sdf(lattice.points).reshape(lattice.shape)
    return zero_crossings_of(values, lattice, mask)


def zero_crossings_within(sdf: SignedDistance, lattice: Lattice, asked: NDArray[np.bool_]) -> ZeroCrossings:
    """Extract a zero level set where it matters, asking for the distance nowhere else.

    Args:
        sdf: The signed distance.
        lattice: Where to look.
        asked: (X, Y, Z) lattice points at which it is asked; only cubes whose corners all were count.

    Returns:
        The zero-crossings; empty if there are none.
    """
    values = np.ones(lattice.shape, np.float32)
    if asked.any():
        values[asked] = sdf(lattice.points_in(asked))
    whole = asked.copy()
    for axis in range(3):  # marching cubes takes a cube where the mask holds at its highest corner
        whole &= np.roll(whole, 1, axis)
    return zero_crossings_of(values, lattice, whole)


def zero_crossings_of(
    values: NDArray[np.float32], lattice: Lattice, mask: NDArray[np.bool_] | None = None
) -> ZeroCrossings:
    """Run marching cubes on (X, Y, Z) distances that are at hand; see `extract_zero_crossings`."""
    if values.size == 0 or not values.min() < 0.0 < values.max():
        return EMPTY
    spacing = (float(lattice.spacing_m[0]), float(lattice.spacing_m[1]), float(lattice.spacing_m[2]))
    try:
        vertices, faces, _, _ = marching_cubes(  # type: ignore[no-untyped-call]
            values, 0.0, spacing=spacing, mask=mask, gradient_direction="descent"
        )
    except RuntimeError:  # signs differ, but no cube inside the mask is crossed
        return EMPTY
    return ZeroCrossings((vertices + lattice.low).astype(np.float32), faces.astype(np.int32))
