"""Which surface samples each candidate pose of the agent would cover: the reachable-visible surface.

One ray from each position to each sample decides for all headings; no pose is rendered. The file that
keeps tables between runs is the business of `anm_gym.metrics.table_cache`.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anm_gym.checks import check_at_least, check_positive
from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.mesh import TriangleMesh
from anm_gym.metrics.completion import THRESHOLD_M
from anm_gym.metrics.depth_view import MAX_DEPTH_M, MIN_DEPTH_M
from anm_gym.metrics.samples import SurfaceSamples
from anm_gym.sim.camera import DepthCamera
from anm_gym.sim.traversable import TraversableGrid


@dataclass(frozen=True)
class ViewTableSettings:
    """How densely poses and surface are sampled."""

    num_samples: int = 20_480
    """Surface samples, the first ones of the completion samples."""
    spacing_m: float = 0.5
    """Distance of candidate positions, metres."""
    num_headings: int = 12
    """Headings at each position, evenly spaced from 0."""
    max_positions: int = 1500
    """Limit of memory: on a larger floor the positions are spaced wider."""

    def __post_init__(self) -> None:
        check_at_least(self, 1, "num_samples", "num_headings", "max_positions")
        check_positive(self, "spacing_m")


@dataclass(frozen=True, eq=False)
class ViewTable:
    """Candidate poses and the samples that a frame taken there would cover.

    A sample is covered by a pose when it lies within 5 cm of the plane of the first surface towards it and
    the pixel nearest to its foot on that plane falls within 5 cm of it. That is the rule of the completion
    ratio, but for what neighbouring surfaces contribute at edges.
    """

    points: NDArray[np.float64]
    """(M, 3) float64 surface samples, metres, world frame."""
    positions_xz: NDArray[np.float64]
    """(P, 2) float64 floor points, metres."""
    headings_rad: NDArray[np.float64]
    """(K,) float64 headings, radians, ascending from 0."""
    bits: NDArray[np.uint64]
    """(P, K, W) uint64, samples packed 64 a word, see `pack` and `unpack`."""

    @property
    def num_samples(self) -> int:
        """Number of samples, M."""
        return len(self.points)

    @cached_property
    def visible(self) -> NDArray[np.bool_]:
        """(M,) bool: covered by at least one candidate pose."""
        return unpack(np.bitwise_or.reduce(self.bits, axis=(0, 1)), self.num_samples)

    def covers(self, position_index: int, heading_index: int) -> NDArray[np.bool_]:
        """(M,) bool: the samples that one pose covers."""
        return unpack(self.bits[position_index, heading_index], self.num_samples)


def pack(mask: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """Pack (..., M) bool into (..., ceil(M / 64)) uint64; the last word is filled with zeros."""
    width = [(0, 0)] * (mask.ndim - 1) + [(0, -mask.shape[-1] % 64)]
    return np.packbits(np.pad(mask, width), axis=-1, bitorder="little").view(np.uint64)


def unpack(words: NDArray[np.uint64], count: int) -> NDArray[np.bool_]:
    """Undo `pack`: (W,) uint64 into (count,) bool."""
    return np.unpackbits(words.view(np.uint8), count=count, bitorder="little").astype(bool)


def build_view_table(
    samples: SurfaceSamples,
    camera: DepthCamera,
    mesh: TriangleMesh,
    floor_y_m: float,
    positions_xz: NDArray[np.float64],
    num_headings: int = 12,
) -> ViewTable:
    """Find what every candidate pose covers.

    Args:
        samples: The surface samples.
        camera: Casts the rays and says what an image looks like.
        mesh: The mesh that the camera sees.
        floor_y_m: Height of the floor, metres.
        positions_xz: (P, 2) candidate positions, metres.
        num_headings: Headings at each position.

    Returns:
        The table.

    Raises:
        ValueError: If there is no position.
    """
    if len(positions_xz) == 0:
        raise ValueError("`positions_xz` must have at least one position, got none")
    headings = np.arange(num_headings, dtype=np.float64) * (2.0 * np.pi / num_headings)
    bits = np.empty((len(positions_xz), num_headings, -(-len(samples) // 64)), np.uint64)
    height_m = floor_y_m + camera.spec.sensor_height_m
    for index, (x, z) in enumerate(positions_xz):
        targets = _targets(samples, np.array([x, height_m, z]), camera, mesh)
        for column, heading in enumerate(headings):
            mask = np.zeros(len(samples), bool)
            mask[targets.index] = _resolved(targets, camera.spec, float(heading))
            bits[index, column] = pack(mask)
    return ViewTable(samples.points, positions_xz, headings, bits)


def candidate_positions(
    grid: TraversableGrid, component: int = 1, spacing_m: float = 0.5, max_positions: int = 1500
) -> NDArray[np.float64]:
    """Choose positions about evenly over a navigable part: in each square the cell with most clearance.

    Args:
        grid: The true traversable grid.
        component: Label of the part.
        spacing_m: Side of the squares, metres; larger where there would be too many.
        max_positions: About the most positions to choose.

    Returns:
        (P, 2) float64 floor points, metres, in raster order of the squares.

    Raises:
        ValueError: If the part has no cell.
    """
    cells = np.argwhere(grid.component == component)
    if component < 1 or len(cells) == 0:
        raise ValueError(f"`component` must be the label of a navigable part, got {component}")
    area_m2 = len(cells) * grid.frame.cell_m**2
    side = max(1, int(np.ceil(max(spacing_m, np.sqrt(area_m2 / max_positions)) / grid.frame.cell_m)))
    squares = cells // side
    keys = squares[:, 0] * (squares[:, 1].max() + 1) + squares[:, 1]
    order = np.lexsort((-grid.clearance_m[cells[:, 0], cells[:, 1]], keys))
    _, first = np.unique(keys[order], return_index=True)
    return grid.frame.centers_of(cells[order[first]])


@dataclass(frozen=True, eq=False)
class _Targets:
    """Samples in sight of a position and the plane on which a frame would observe them."""

    index: NDArray[np.int64]
    """(L,) which samples."""
    offsets: NDArray[np.float32]
    """(L, 3) samples relative to the camera, world frame, metres."""
    feet: NDArray[np.float32]
    """(L, 3) their nearest points on the plane of the first surface towards them, likewise."""
    normals: NDArray[np.float32]
    """(L, 3) unit normals of that plane."""


def _targets(
    samples: SurfaceSamples, center: NDArray[np.float64], camera: DepthCamera, mesh: TriangleMesh
) -> _Targets:
    """Find the samples that lie within the threshold of the first surface on the ray towards them.

    The back of a thin panel counts, as it does for the completion ratio: what matters is the distance to
    the plane of the surface in front, not the distance along the ray.
    """
    rays = (samples.points - center).astype(np.float32)
    range_m = np.linalg.norm(rays, axis=1)
    corner = np.hypot(1.0, np.hypot(camera.spec.width_px, camera.spec.height_px) / 2 / camera.spec.focal_px)
    nearest_m, farthest_m = _depth_range_m(camera.spec)
    index = np.flatnonzero((range_m > nearest_m) & (range_m < corner * farthest_m))
    rays = rays[index]
    hits = camera.cast(np.ascontiguousarray(np.broadcast_to(center.astype(np.float32), rays.shape)), rays)
    is_behind = hits.distance < 1.0
    normals = np.where(is_behind[:, None], mesh.normals[hits.triangle], samples.normals[index])
    normals = normals.astype(np.float32)
    behind = np.where(is_behind, 1.0 - hits.distance, np.float32(0.0))[:, None] * rays
    height_m = np.einsum("ij,ij->i", behind, normals)
    near = np.flatnonzero(np.abs(height_m) < THRESHOLD_M)
    feet = rays[near] - height_m[near, None] * normals[near]
    return _Targets(index[near], rays[near], feet, normals[near])


def _depth_range_m(spec: CameraSpec) -> tuple[float, float]:
    """Depths that the metric counts and the camera has, metres."""
    return max(MIN_DEPTH_M, spec.min_depth_m), min(MAX_DEPTH_M, spec.max_depth_m)


def _resolved(targets: _Targets, spec: CameraSpec, heading_rad: float) -> NDArray[np.bool_]:
    """Tell which targets have the pixel nearest to their foot, cast on its plane, within the threshold."""
    rotation = camera_pose(np.zeros(3), heading_rad)[:3, :3].astype(np.float32)
    x, y, z = (targets.feet @ rotation).T
    nearest_m, farthest_m = _depth_range_m(spec)
    ahead = -z > nearest_m
    scale = spec.focal_px / np.where(ahead, -z, 1.0)
    column, row = np.floor(scale * x + spec.width_px / 2.0), np.floor(spec.height_px / 2.0 - scale * y)
    in_image = ahead & (column >= 0) & (column < spec.width_px) & (row >= 0) & (row < spec.height_px)
    normals = targets.normals @ rotation
    rays = np.stack([column + 0.5 - spec.width_px / 2.0, spec.height_px / 2.0 - row - 0.5], axis=1)
    rays = np.column_stack([rays / spec.focal_px, np.full(len(rays), -1.0)])
    toward = np.einsum("ij,ij->i", normals, rays)
    plane_m = np.einsum("ij,ij->i", targets.normals, targets.feet)
    depth_m = np.divide(plane_m, toward, out=-z.astype(np.float64), where=np.abs(toward) > 1e-6)
    miss_m = np.linalg.norm(rays * depth_m[:, None] - targets.offsets @ rotation, axis=1)
    in_range = (depth_m >= nearest_m) & (depth_m <= farthest_m)
    return np.asarray(in_image & in_range & (miss_m < THRESHOLD_M))
