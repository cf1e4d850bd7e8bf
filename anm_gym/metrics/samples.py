"""Area-uniform samples of a surface: the points at which every metric asks its question."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anm_gym.mesh import TriangleMesh


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Independent samples, uniform by area, so that any prefix of them is uniform as well.

    Raises:
        ValueError: If the arrays differ in length.
    """

    points: NDArray[np.float64]
    """(N, 3) float64, metres, world frame."""
    normals: NDArray[np.float64]
    """(N, 3) float64 unit normals of the faces, by winding; zero on a degenerate face."""
    faces: NDArray[np.int64]
    """(N,) int64 face of the mesh under each sample."""
    area_m2: float
    """Area of the whole surface, square metres."""

    def __post_init__(self) -> None:
        lengths = {len(self.points), len(self.normals), len(self.faces)}
        if len(lengths) != 1:
            raise ValueError(f"`points`, `normals` and `faces` must be equally long, got {sorted(lengths)}")

    def __len__(self) -> int:
        return len(self.points)

    def head(self, count: int) -> "SurfaceSamples":
        """Keep the first `count` samples, which are again uniform by area."""
        return SurfaceSamples(self.points[:count], self.normals[:count], self.faces[:count], self.area_m2)


def sample_surface(mesh: TriangleMesh, count: int, rng: np.random.Generator) -> SurfaceSamples:
    """Draw samples uniformly by area.

    Args:
        mesh: The surface.
        count: Number of samples.
        rng: Source of randomness; the same state draws the same samples.

    Returns:
        `count` samples in random order.

    Raises:
        ValueError: If `count` is less than 1 or the mesh has no area.
    """
    if count < 1:
        raise ValueError(f"`count` must be at least 1, got {count}")
    ends_m2 = np.cumsum(mesh.areas_m2)
    area_m2 = float(ends_m2[-1])
    if not area_m2 > 0.0:
        raise ValueError(f"the mesh must have a positive area, got {area_m2} square metres")
    faces = np.searchsorted(ends_m2, rng.random(count) * area_m2, side="right")
    faces = np.minimum(faces, len(mesh.faces) - 1)
    root, along = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.stack([1.0 - root, root * (1.0 - along), root * along], axis=1)
    points = np.einsum("nk,nkd->nd", weights, mesh.triangles[faces])
    return SurfaceSamples(points, mesh.normals[faces], faces, area_m2)
