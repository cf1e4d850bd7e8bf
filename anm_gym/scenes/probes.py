"""Rays from where an agent could stand: is there a wall, a ceiling, a way out for the light?"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.backends import cpu_backend, make_depth_camera
from anm_gym.sim.camera import DepthCamera
from anm_gym.sim.traversable import ROOF_M, TraversableGrid

EYE_HEIGHT_M: Final = 1.25
"""Height of the probes above the floor, metres: the camera of Active Neural Mapping, Sec. 5.1."""
WALL_M: Final = 20.0
"""Farthest wall, metres; what is farther may be a horizon (ours)."""
_NUM_LEVEL_RAYS: Final = 64
_NUM_SPHERE_RAYS: Final = 128
_UP: Final = np.array([[0.0, 1.0, 0.0]])


@dataclass(frozen=True)
class Surroundings:
    """What rays from the navigable part of a storey meet."""

    covered_share: float
    """Share of the points with something overhead."""
    ceiling_y_m: float | None
    """Median height of what is overhead, metres; None where less than half is covered."""
    roofed_share: float
    """Share of the points with something overhead that is no farther than a roof."""
    level_escape_share: float
    """Share of the level rays that meet nothing."""
    walled_share: float
    """Share of the level rays that meet something no farther than walls are."""
    escape_share: float
    """Share of the rays in all directions that meet nothing."""
    back_face_share: float
    """Share of the rays in all directions that meet the back of a face, of those that meet one."""

    @property
    def is_sheltered(self) -> bool:
        """Whether the place is indoors: mostly under a roof, or mostly between walls; a sky is neither."""
        return self.is_roofed or self.is_walled

    @property
    def is_walled(self) -> bool:
        """Whether the place is mostly between walls."""
        return self.walled_share >= 0.5

    @property
    def is_roofed(self) -> bool:
        """Whether most of the place is under a roof."""
        return self.roofed_share >= 0.5


def make_probe(mesh: TriangleMesh) -> DepthCamera:
    """Build the ray caster that `probe_surroundings` needs, once per mesh."""
    return make_depth_camera(mesh, CameraSpec(width_px=1, height_px=1), backend=cpu_backend())


def probe_surroundings(
    caster: DepthCamera, mesh: TriangleMesh, grid: TraversableGrid, floor_y_m: float, num_points: int = 100
) -> Surroundings:
    """Cast level, upward and all-round rays from evenly picked navigable points.

    Args:
        caster: Ray caster over `mesh`.
        mesh: The mesh whose winding is judged.
        grid: Traversable grid of the storey, with at least one navigable cell.
        floor_y_m: Height of the floor, metres.
        num_points: Most points to cast from.

    Returns:
        Shares over all points; no randomness is involved.
    """
    eyes = _eyes(grid, floor_y_m, num_points)
    overhead_m, _ = _cast(caster, eyes, _UP)
    level_m, _ = _cast(caster, eyes, _level_directions(_NUM_LEVEL_RAYS))
    directions = _sphere_directions(_NUM_SPHERE_RAYS)
    around_m, triangles = _cast(caster, eyes, directions)
    is_hit = np.isfinite(around_m)
    facing = (mesh.normals[triangles] * directions).sum(axis=-1)
    is_covered = np.isfinite(overhead_m)
    covered_share = float(is_covered.mean())
    height_m = float(np.median(overhead_m[is_covered])) if covered_share >= 0.5 else None
    return Surroundings(
        covered_share=covered_share,
        roofed_share=float((overhead_m <= ROOF_M - EYE_HEIGHT_M).mean()),
        ceiling_y_m=None if height_m is None else round(floor_y_m + EYE_HEIGHT_M + height_m, 3),
        level_escape_share=float(np.isinf(level_m).mean()),
        walled_share=float((level_m <= WALL_M).mean()),
        escape_share=float(1.0 - is_hit.mean()),
        back_face_share=float((facing[is_hit] > 0.0).mean()) if is_hit.any() else 0.0,
    )


def _eyes(grid: TraversableGrid, floor_y_m: float, num_points: int) -> NDArray[np.float64]:
    """(N, 3) points at eye height over every k-th cell of the largest navigable part."""
    cells = np.argwhere(grid.component == 1)
    picked = cells[np.linspace(0, len(cells) - 1, min(num_points, len(cells))).astype(np.int64)]
    eyes = np.full((len(picked), 3), floor_y_m + EYE_HEIGHT_M)
    eyes[:, [0, 2]] = grid.frame.centers_of(picked)
    return eyes


def _cast(
    caster: DepthCamera, eyes: NDArray[np.float64], directions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Cast every direction from every eye: (N, D) distances, metres, and (N, D) faces (-1: none)."""
    shape = (len(eyes), len(directions))
    origins = np.repeat(eyes, shape[1], axis=0).astype(np.float32)
    hits = caster.cast(origins, np.tile(directions, (shape[0], 1)).astype(np.float32))
    return np.asarray(hits.distance, np.float64).reshape(shape), np.asarray(hits.triangle, np.int64).reshape(
        shape
    )


def _level_directions(count: int) -> NDArray[np.float64]:
    angles = (np.arange(count) + 0.5) * (2.0 * np.pi / count)
    return np.stack([np.cos(angles), np.zeros(count), np.sin(angles)], axis=1)


def _sphere_directions(count: int) -> NDArray[np.float64]:
    """(count, 3) unit vectors spread evenly over the sphere (Fibonacci spiral)."""
    y = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angles = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - y * y)
    return np.stack([radius * np.cos(angles), y, radius * np.sin(angles)], axis=1)
