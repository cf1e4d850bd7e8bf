"""How much unseen space a view would show: the gain of next-best-view planning, by casting rays.

`anm_gym.map.volume` logs what was seen; here it is asked what a camera elsewhere would add. Surface that
is predicted by a neural map is weighed in `anm_gym.map.views` instead.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anm_gym.checks import check_at_least, check_positive
from anm_gym.geometry import CameraSpec
from anm_gym.map.views import sectors_in_view
from anm_gym.map.volume import FREE, OCCUPIED, UNKNOWN, ObservedVolume

SEEN, UNSEEN, WALL = 0, 1, 2
STEPS_BETWEEN_CHECKS = 6
"""Samples after which the rays that have ended are dropped."""
LEAST_HOPE = 0.05
"""Rays with less hope are dropped."""


@dataclass(frozen=True)
class UnseenSettings:
    """Which rays are cast and what counts along them (ours)."""

    range_m: float = 4.0
    """Horizontal length of a ray, metres; at least one voxel."""
    decay_m: float = 1.5
    """Length of unknown space after which a ray counts 1/e of what follows, metres; infinite counts all."""
    num_headings: int = 36
    """Headings of each place."""
    rays_per_heading: int = 2
    """Columns of rays in the sector of a heading."""
    num_elevations: int = 9
    """Rays in a column, from the lower to the upper border of the image."""
    leaves_out_shell: bool = True
    """Do not count unknown voxels that touch an occupied one: rays are not trusted just before a hit."""

    def __post_init__(self) -> None:
        check_positive(self, "range_m", "decay_m")
        check_at_least(self, 1, "num_headings", "rays_per_heading", "num_elevations")


@dataclass(frozen=True, eq=False)
class UnseenByCell:
    """Where the unseen volume lies that views would show, so that no view is praised for another's."""

    total_m3: NDArray[np.float64]
    """(C,) unseen volume over each cell of the floor that some view shows, cubic metres."""
    share: NDArray[np.float32]
    """(P, H, C) share of it that each place shows at each heading, with the hope to see it."""
    settled: NDArray[np.float32]
    """(P, H, C) share of it that lies in view: afterwards it is seen, or known to be hidden from there."""


def unseen_volume(
    volume: ObservedVolume,
    centers: NDArray[np.float64],
    floor_y_m: float,
    camera: CameraSpec,
    settings: UnseenSettings,
) -> NDArray[np.float64]:
    """Estimate the unseen volume that level views would show.

    Rays end at occupied voxels, below the floor and above all space that lies before a surface; they pass
    unknown voxels, with less and less hope.

    Args:
        volume: What rays have passed and hit.
        centers: (P, 3) camera centres, metres, world frame.
        floor_y_m: Height of the floor, metres.
        camera: Its field of view.
        settings: Rays, range and decay.

    Returns:
        (P, H) cubic metres; heading h is ``2 pi h / H`` radians.

    Source:
        Bircher et al., Receding Horizon Next-Best-View Planner, 2016, without decay; that is ours.
    """
    if len(centers) == 0:
        return np.zeros((0, settings.num_headings))
    samples = _cast(_Box(volume, centers, floor_y_m, settings), centers, camera, settings)
    size = len(centers) * settings.num_headings
    sectors = np.bincount(samples.sector, samples.hoped_m3, minlength=size).astype(np.float64)
    return sectors_in_view(sectors.reshape(len(centers), settings.num_headings), camera)


def unseen_by_cell(
    volume: ObservedVolume,
    centers: NDArray[np.float64],
    floor_y_m: float,
    camera: CameraSpec,
    settings: UnseenSettings,
    cell_m: float = 0.5,
) -> UnseenByCell:
    """Like `unseen_volume`, sorted by where the volume lies.

    Args:
        volume: What rays have passed and hit.
        centers: (P, 3) camera centres, metres, world frame.
        floor_y_m: Height of the floor, metres.
        camera: Its field of view.
        settings: Rays, range and decay.
        cell_m: Edge of a cell of the floor, metres.

    Returns:
        The shares of each view.
    """
    if len(centers) == 0:
        nothing = np.zeros((0, settings.num_headings, 0), np.float32)
        return UnseenByCell(np.zeros(0), nothing, nothing)
    box = _Box(volume, centers, floor_y_m, settings)
    samples = _cast(box, centers, camera, settings)
    edge = max(1, round(cell_m * float(box.per_m)))
    cells, total_m3 = box.cells(samples.voxel, edge)
    shown, cell = np.unique(cells, return_inverse=True)
    shape = (len(centers), settings.num_headings, len(shown))
    total_m3 = np.maximum(total_m3[shown], 1e-9)

    def share(volume_m3: NDArray[np.float32]) -> NDArray[np.float32]:
        flat = samples.sector * len(shown) + cell
        by_sector = np.bincount(flat, volume_m3, minlength=int(np.prod(shape))).astype(np.float64)
        in_view = sectors_in_view(by_sector.reshape(shape), camera)
        return np.minimum(in_view / total_m3, 1.0).astype(np.float32)

    return UnseenByCell(total_m3, share(samples.hoped_m3), share(samples.volume_m3))


class _Box:
    """A box of voxels, each seen, unseen or a wall to rays.

    Args:
        volume: What rays have passed and hit.
        centers: (P, 3) the box is around these, metres.
        floor_y_m: Everything below is a wall, metres.
        settings: Range and shell.
    """

    def __init__(
        self,
        volume: ObservedVolume,
        centers: NDArray[np.float64],
        floor_y_m: float,
        settings: UnseenSettings,
    ) -> None:
        per_m = 1.0 / volume.voxel_m
        reach_m = np.array([settings.range_m, 0.0, settings.range_m])
        low = np.floor((centers.min(axis=0) - reach_m) * per_m).astype(np.int64) - 2
        high = np.floor((centers.max(axis=0) + reach_m) * per_m).astype(np.int64) + 3
        low[1] = min(low[1], int(np.floor(floor_y_m * per_m)) - 1)
        high[1] = max(high[1], int(volume.low_index[1]) + volume.states.shape[1] + 1)
        states = volume.window(low, high)
        occupied = states == OCCUPIED
        unseen = states == UNKNOWN
        if settings.leaves_out_shell:
            unseen &= ~_grown(occupied)
        self.codes = unseen.astype(np.uint8)
        self.codes[occupied] = WALL
        floor = int(np.floor(floor_y_m * per_m + 0.5)) - low[1]
        seen_rows = np.flatnonzero((states >= FREE).any(axis=(0, 2)))
        top = int(seen_rows[-1]) + 1 if len(seen_rows) else states.shape[1]
        self.codes[:, :floor][states[:, :floor] != FREE] = WALL
        self.codes[:, top:] = WALL
        self.low, self.per_m = low.astype(np.float32), np.float32(per_m)

    def cells(self, voxels: NDArray[np.int64], edge: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Floor cells, (N,), `edge` voxels wide, of voxels; and the unseen volume over every cell, m³."""
        size_x, _, size_z = self.codes.shape
        columns = -(-size_z // edge)
        x, z = voxels // (self.codes.shape[1] * size_z), voxels % size_z
        unseen = (self.codes == UNSEEN).sum(axis=1)
        flat = (np.arange(size_x) // edge)[:, None] * columns + np.arange(size_z) // edge
        total = np.bincount(flat.ravel(), unseen.ravel()) / float(self.per_m) ** 3
        return x // edge * columns + z // edge, total


def _grown(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Voxels of a mask and all that touch one."""
    for axis in range(3):
        first = np.moveaxis(mask, axis, 0)
        grown = first.copy()
        grown[1:] |= first[:-1]
        grown[:-1] |= first[1:]
        mask = np.moveaxis(grown, 0, axis)
    return mask


@dataclass(frozen=True, eq=False)
class _Samples:
    """Unseen samples along rays."""

    sector: NDArray[np.int64]
    """(N,) place times number of headings, plus heading."""
    voxel: NDArray[np.int64]
    """(N,) flat index in the box."""
    volume_m3: NDArray[np.float32]
    """(N,) the volume that it stands for."""
    hoped_m3: NDArray[np.float32]
    """(N,) the same, times the hope to see it."""


def _cast(box: _Box, centers: NDArray[np.float64], camera: CameraSpec, settings: UnseenSettings) -> _Samples:
    """Follow the rays of all places side by side."""
    voxel_m = 1.0 / float(box.per_m)
    directions, slope_step = _rays(camera, settings)
    # In cylindrical coordinates, with the slope of a ray for its height, the volume is s^2 ds dphi dslope.
    element = voxel_m * slope_step * 2.0 * np.pi / (settings.num_headings * settings.rays_per_heading)
    starts = centers.astype(np.float32) * box.per_m - box.low
    steps = np.tile(directions.T, len(centers))  # one voxel ahead, horizontally
    lines = np.repeat(starts.T, len(directions), axis=1) + np.float32(0.5) * steps
    decay = np.exp(-voxel_m * np.linalg.norm(directions, axis=1) / settings.decay_m).astype(np.float32)
    decay = np.tile(decay, len(centers))
    hope, ray = np.ones(len(decay), np.float32), np.arange(len(decay))
    parts = []
    for index in range(max(1, round(settings.range_m / voxel_m))):
        flat = _flat_index(lines, box.codes.shape)
        code = box.codes.reshape(-1)[flat]
        hope[code == WALL] = 0.0
        found = np.flatnonzero((code == UNSEEN) & (hope > 0.0))
        volume_m3 = np.full(len(found), element * ((index + 0.5) * voxel_m) ** 2, np.float32)
        parts.append((ray[found], flat[found], volume_m3, volume_m3 * hope[found]))
        hope[found] *= decay[found]
        lines += steps
        if index % STEPS_BETWEEN_CHECKS == STEPS_BETWEEN_CHECKS - 1:
            kept = np.flatnonzero(hope > LEAST_HOPE)
            ray, hope, decay = ray[kept], hope[kept], decay[kept]
            lines, steps = lines[:, kept], steps[:, kept]
    rays, voxels, volume, hoped = (np.concatenate(values) for values in zip(*parts, strict=True))
    return _Samples(rays // (settings.rays_per_heading * settings.num_elevations), voxels, volume, hoped)


def _rays(camera: CameraSpec, settings: UnseenSettings) -> tuple[NDArray[np.float32], float]:
    """(columns * elevations, 3) directions of horizontal length 1, and the slope between two elevations."""
    columns = settings.num_headings * settings.rays_per_heading
    offset = 0.5 * (settings.rays_per_heading - 1)
    heading = 2.0 * np.pi * (np.arange(columns) - offset) / columns
    steepest = 0.5 * camera.height_px / camera.focal_px
    slope_step = 2.0 * steepest / settings.num_elevations
    slope = slope_step * (np.arange(settings.num_elevations) + 0.5) - steepest
    rays = np.empty((columns, settings.num_elevations, 3), np.float32)
    rays[..., 0], rays[..., 2] = -np.sin(heading)[:, None], -np.cos(heading)[:, None]
    rays[..., 1] = slope
    return rays.reshape(-1, 3), slope_step


def _flat_index(points: NDArray[np.float32], shape: tuple[int, ...]) -> NDArray[np.int32]:
    """Flat index, (R,), of the voxels of (3, R) points, which lie inside or above and below the box."""
    flat: NDArray[np.int32] = points[0].astype(np.int32)
    flat *= shape[1]
    flat += np.clip(points[1], 0.0, shape[1] - 1).astype(np.int32)
    flat *= shape[2]
    flat += points[2].astype(np.int32)
    return flat
