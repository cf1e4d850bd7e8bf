"""Occupancy: what posed depth has shown of the floor, from above, for planning and for frontiers.

The true traversable grid of a mesh is `anm_gym.sim.traversable`; this one knows only what was seen.
Numpy only: baselines without a neural map use it as well.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from anm_gym.checks import check_at_least, check_positive
from anm_gym.geometry import CameraSpec, forward_xz, heading_of
from anm_gym.sim.grid import GridFrame

GROWTH_CELLS = 64
"""The raster grows by at least this many cells at a time."""
ROWS_USED = 128
"""Image rows looked at: every column counts for a thin leg, every second row of 256 is enough."""
CONTACT_REACH_M = 0.15
"""How far ahead of the body's centre a contact is remembered, metres."""
STANCE_M = 0.05
"""Around each place where the agent has stood its centre may stand again, metres."""
LEVEL_TOLERANCE = 1e-3
"""How far the camera's up axis may lean."""


@dataclass(frozen=True)
class OccupancySettings:
    """Heights and ranges that sort depth into floor, obstacle and hole (ours; heights as the body's)."""

    cell_m: float = 0.05
    """Edge of a cell, metres."""
    obstacle_min_m: float = 0.1
    """Lowest obstacle above the floor, metres: what the body steps over is floor."""
    body_height_m: float = 1.5
    """Highest obstacle above the floor, metres: the body passes under what is higher."""
    body_radius_m: float = 0.1
    """Radius around the agent that it stands on, metres."""
    carve_height_m: float = 0.3
    """A ray frees the cells under it only where it is lower than this, metres."""
    hole_depth_m: float = 0.07
    """A ray that gets this far under the floor shows that there is none, metres."""
    max_range_m: float = 8.0
    """Planar depth up to which rays count, metres."""
    hole_range_m: float = 4.0
    """Planar depth up to which missing floor is believed, metres."""
    hit_weight: int = 10
    """Frames of passing rays that a frame with a hit outweighs: a thin leg stays, an outlier goes."""

    def __post_init__(self) -> None:
        check_positive(self, "cell_m", "max_range_m")
        check_at_least(self, 0.0, "body_radius_m", "carve_height_m", "hole_depth_m", "hole_range_m")
        check_at_least(self, 1, "hit_weight")
        if not 0.0 < self.obstacle_min_m < self.body_height_m:
            raise ValueError(
                "`obstacle_min_m` must be in (0, body_height_m), "
                f"got {self.obstacle_min_m} of {self.body_height_m}"
            )


def check_level(world_from_camera: NDArray[np.floating]) -> None:
    """Refuse the (4, 4) pose of a camera that leans, with a ValueError."""
    if abs(float(world_from_camera[1, 1]) - 1.0) > LEVEL_TOLERANCE:
        raise ValueError(
            f"`world_from_camera` must be level, got an up axis with y = {world_from_camera[1, 1]:.3f}; its "
            "axes are right, up and backwards: two of OpenCV's, the second and third column, turn round"
        )


class OccupancyGrid:
    """A top-down log of evidence that grows with what is seen; the camera must be level.

    A cell is occupied while its hits outweigh the rays that passed over it, free if only rays passed
    low over it, or hit its floor, unknown otherwise. What lies in the blind cone under the lowest rays
    is assumed to be free until something is hit there, as it could not be entered otherwise.

    Args:
        floor_y_m: Height of the floor, metres, world frame.
        settings: Heights and ranges.

    Source:
        Ours; the evidence grid of Yamauchi 1997 with counts of frames instead of probabilities.
    """

    def __init__(self, *, floor_y_m: float, settings: OccupancySettings | None = None) -> None:
        self.floor_y_m = floor_y_m
        self.settings = settings or OccupancySettings()
        self.version = 0
        """Number of changes so far: whoever derives something from the grid can tell when it is stale."""
        self._frame: GridFrame | None = None
        self._hits = np.zeros((0, 0), np.int32)
        self._passes = np.zeros((0, 0), np.int32)
        self._assumed = np.zeros((0, 0), bool)
        self._stood = np.zeros((0, 0), bool)
        self._touched = np.zeros((0, 0), bool)
        self._labels: _Labels | None = None
        self._clearance_m: NDArray[np.float32] | None = None

    @classmethod
    def below(
        cls,
        camera: CameraSpec,
        world_from_camera: NDArray[np.floating],
        settings: OccupancySettings | None = None,
    ) -> "OccupancyGrid":
        """Make the grid of the floor over which a camera, (4, 4) pose, is carried at its height."""
        floor_y_m = float(world_from_camera[1, 3]) - camera.sensor_height_m
        return cls(floor_y_m=floor_y_m, settings=settings)

    @property
    def cell_m(self) -> float:
        """Edge of a cell, metres."""
        return self.settings.cell_m

    @property
    def frame(self) -> GridFrame:
        """Where the cells lie; another one once the raster has grown.

        Raises:
            ValueError: Before the first frame.
        """
        if self._frame is None:
            raise ValueError("the occupancy grid must have seen a frame first; call `integrate`")
        return self._frame

    @property
    def occupied(self) -> NDArray[np.bool_]:
        """(rows, columns): an obstacle, a hole in the floor or a contact."""
        return self._label().occupied

    @property
    def free(self) -> NDArray[np.bool_]:
        """(rows, columns): seen to be free at the body's height, and floor."""
        return self._label().free

    @property
    def unknown(self) -> NDArray[np.bool_]:
        """(rows, columns): neither free nor occupied."""
        return self._label().unknown

    @property
    def stood(self) -> NDArray[np.bool_]:
        """(rows, columns): the agent's centre has been here, so it fits, whatever lies beside it."""
        return self._stood

    @property
    def clearance_m(self) -> NDArray[np.float32]:
        """(rows, columns) distance to the nearest occupied cell, metres; unknown cells do not count."""
        if self._clearance_m is None:
            self._clearance_m = clearance_of(self.occupied, self.settings.cell_m)
        return self._clearance_m

    def traversable(self, radius_m: float, *, through_unknown: bool = False) -> NDArray[np.bool_]:
        """Find where a body fits as far as is known; where the agent has stood, it does.

        Args:
            radius_m: The clearance that it needs is more than this, metres.
            through_unknown: Whether it may stand on unknown cells as well as on free ones.

        Returns:
            (rows, columns) bool.
        """
        ground = ~self.occupied if through_unknown else self.free
        return np.asarray((ground & (self.clearance_m > radius_m)) | self._stood)

    def integrate(
        self, depth_m: NDArray[np.float32], camera: CameraSpec, world_from_camera: NDArray[np.floating]
    ) -> None:
        """Log a depth frame.

        Args:
            depth_m: (H, W) or (H, W, 1) float32 planar depth, metres; 0 where nothing is in range.
            camera: The camera that took it.
            world_from_camera: (4, 4) pose of the camera, which must be level.

        Raises:
            ValueError: If the camera is not level.
        """
        check_level(world_from_camera)
        view = _View(depth_m, camera, world_from_camera, self.floor_y_m, self.settings)
        hits, passed, assumed = view.hits(), view.passed(), view.assumed()
        self._cover(np.concatenate([_corners(points) for points in (hits, passed, assumed)]))
        hit = self._mask_of(hits)
        self._hits += hit
        self._passes += self._mask_of(passed) & ~hit
        self._assumed |= self._mask_of(assumed)
        self._stood |= self._mask_of(view.disc(STANCE_M))
        self._changed()

    def mark_blocked(self, position_xz: ArrayLike) -> None:
        """Log for good that a body touched something at a floor point (x, z), metres."""
        point = np.asarray(position_xz, np.float64).reshape(1, 2)
        self._cover(point)
        row, column = self.frame.cells_of(point)[0]
        self._touched[row, column] = True
        self._changed()

    def mark_contact(self, world_from_camera: NDArray[np.floating]) -> None:
        """Log a contact ahead of a camera, (4, 4) pose: a short line across, as it may be out of view."""
        position_xz, heading_rad = world_from_camera[[0, 2], 3], heading_of(world_from_camera)
        ahead, left = forward_xz(heading_rad), forward_xz(heading_rad + np.pi / 2.0)
        for side_m in (-self.cell_m, 0.0, self.cell_m):
            self.mark_blocked(position_xz + CONTACT_REACH_M * ahead + side_m * left)

    def _label(self) -> "_Labels":
        if self._labels is None:
            occupied = (self._hits > 0) & (self.settings.hit_weight * self._hits >= self._passes)
            occupied |= self._touched
            free = ((self._passes > 0) | self._assumed) & ~occupied
            self._labels = _Labels(occupied, free, ~(free | occupied))
        return self._labels

    def _changed(self) -> None:
        self.version += 1
        self._labels = self._clearance_m = None

    def _mask_of(self, points: "_Points") -> NDArray[np.bool_]:
        """Mark the cells under points, which must lie inside the raster."""
        frame = self.frame
        per_m = np.float32(1.0 / frame.cell_m)
        # Truncation is the floor here, as no point lies under the origin.
        column = ((points[0] - np.float32(frame.origin_xz[0])) * per_m).astype(np.int32)
        row = ((points[1] - np.float32(frame.origin_xz[1])) * per_m).astype(np.int32)
        mask = np.zeros(frame.shape[0] * frame.shape[1], bool)
        mask[row * np.int32(frame.shape[1]) + column] = True
        return mask.reshape(frame.shape)

    def _cover(self, points_xz: NDArray[np.floating]) -> None:
        """Grow the raster until it holds every point with a cell to spare."""
        cell_m = self.settings.cell_m
        low = np.floor(points_xz.min(axis=0) / cell_m).astype(int) - 1
        high = np.floor(points_xz.max(axis=0) / cell_m).astype(int) + 2
        if self._frame is None:
            self._frame = GridFrame((low[0] * cell_m, low[1] * cell_m), cell_m, (1, 1))
            self._hits, self._passes = np.zeros((1, 1), np.int32), np.zeros((1, 1), np.int32)
            self._assumed, self._stood = np.zeros((1, 1), bool), np.zeros((1, 1), bool)
            self._touched = np.zeros((1, 1), bool)
        first = np.round(np.asarray(self._frame.origin_xz) / cell_m).astype(int)
        before = _growth(first - low)
        after = _growth(high - first - np.array(self._frame.shape[::-1]))
        if before.any() or after.any():
            self._grow(first - before, before[::-1], after[::-1])

    def _grow(self, first: NDArray[np.int_], before: NDArray[np.int_], after: NDArray[np.int_]) -> None:
        pad = tuple((int(low), int(high)) for low, high in zip(before, after, strict=True))
        self._hits, self._passes = np.pad(self._hits, pad), np.pad(self._passes, pad)
        self._assumed, self._stood = np.pad(self._assumed, pad), np.pad(self._stood, pad)
        self._touched = np.pad(self._touched, pad)
        cell_m, shape = self.settings.cell_m, self._hits.shape
        self._frame = GridFrame((float(first[0] * cell_m), float(first[1] * cell_m)), cell_m, shape)


def clearance_of(occupied: NDArray[np.bool_], cell_m: float) -> NDArray[np.float32]:
    """Distance between each cell's centre and the nearest occupied one's, (rows, columns) float32 metres."""
    if not occupied.any():
        return np.full(occupied.shape, np.inf, np.float32)
    return np.asarray(cell_m * ndimage.distance_transform_edt(~occupied), np.float32)


@dataclass(frozen=True)
class _Labels:
    """The three exclusive labels of every cell."""

    occupied: NDArray[np.bool_]
    free: NDArray[np.bool_]
    unknown: NDArray[np.bool_]


class _View:
    """A depth frame of a level camera, sorted into floor points (x, z) by what they show.

    Every image column is a vertical plane, so a pixel is a forward distance (its depth), the same
    sideways slope along the column and the same downward slope along the row.
    """

    def __init__(
        self,
        depth_m: NDArray[np.float32],
        camera: CameraSpec,
        world_from_camera: NDArray[np.floating],
        floor_y_m: float,
        settings: OccupancySettings,
    ) -> None:
        stride = max(1, camera.height_px // ROWS_USED)
        rows = slice(camera.height_px - 1 - stride * ((camera.height_px - 1) // stride), None, stride)
        self.depth_m = depth_m.reshape(camera.height_px, camera.width_px)[rows]
        self.hole_range_m = min(settings.hole_range_m, camera.max_depth_m)
        self.side = camera.directions[0, :, 0]
        self.up = camera.directions[rows, 0, 1]
        self.pose, self.settings = world_from_camera, settings
        self.height_m = np.float32(world_from_camera[1, 3] - floor_y_m)
        # Nothing shorter than the body's radius can stand before the camera: empty then means far.
        self.sees_void = camera.min_depth_m <= settings.body_radius_m
        self.bin_m = np.float32(0.5 * settings.cell_m)

    def hits(self) -> "_Points":
        """Obstacles in the body's slab, and points where the floor is missing."""
        height_m = self.up[:, None] * self.depth_m
        height_m += self.height_m
        hit = (height_m >= self.settings.obstacle_min_m) & (height_m <= self.settings.body_height_m)
        hit &= (self.depth_m > 0.0) & (self.depth_m <= self.settings.max_range_m)
        flat = np.flatnonzero(hit)
        obstacles = self._to_world(self.depth_m.ravel()[flat], flat % hit.shape[1])
        holes = self._holes()
        return np.concatenate([obstacles[0], holes[0]]), np.concatenate([obstacles[1], holes[1]])

    def passed(self) -> "_Points":
        """Floor that was hit, and what rays passed under the carving height before floor or obstacle."""
        down, depth_m, floor_m = self._downward()
        start_m = np.maximum((self.height_m - self.settings.carve_height_m) / down, np.float32(0.0))
        end_m = np.where(depth_m <= floor_m, depth_m, np.float32(0.0))
        return self._between(start_m, end_m)

    def assumed(self) -> "_Points":
        """The disc that the agent stands on, and the blind cone under the lowest rays."""
        body = self.disc(self.settings.body_radius_m)
        _, depth_m, floor_m = self._downward()
        if len(floor_m) == 0 or floor_m[-1, 0] >= self.settings.max_range_m:
            return body
        ahead_m = np.arange(0.5 * self.bin_m, floor_m[-1, 0], self.bin_m, dtype=np.float32)
        ahead, column = np.nonzero(ahead_m[:, None] < np.minimum(depth_m[-1], floor_m[-1]))
        cone = self._to_world(ahead_m[ahead], column)
        return np.concatenate([body[0], cone[0]]), np.concatenate([body[1], cone[1]])

    def disc(self, radius_m: float) -> "_Points":
        """Points about the place where the agent stands."""
        around = np.arange(-radius_m, radius_m + 1e-6, self.bin_m, dtype=np.float32)
        x, z = np.meshgrid(around, around)
        inside = x**2 + z**2 <= radius_m**2 + 1e-6
        return np.float32(self.pose[0, 3]) + x[inside], np.float32(self.pose[2, 3]) + z[inside]

    def _holes(self) -> "_Points":
        """Points where two rays of a column, one above the other, go under the floor."""
        _, depth_m, floor_m = self._downward()
        goes_under = (depth_m > floor_m) | ((depth_m <= 0.0) & self.sees_void)
        goes_under &= floor_m < self.hole_range_m
        goes_under[1:] &= goes_under[:-1].copy()
        row, column = np.nonzero(goes_under)
        return self._to_world(floor_m[row, 0], column)

    def _downward(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """Falling rows: downward slope (R, 1), depth (R, W), and depth at which floor is missed (R, 1)."""
        falling = int((self.up >= 0.0).sum())
        down = -self.up[falling:, None]
        floor_m = (self.height_m + np.float32(self.settings.hole_depth_m)) / down
        return down, self.depth_m[falling:], np.minimum(floor_m, np.float32(self.settings.max_range_m))

    def _between(self, start_m: NDArray[np.float32], end_m: NDArray[np.float32]) -> "_Points":
        """Points every half cell along the columns, in the union of intervals of depth.

        Args:
            start_m: (R, 1) depth at which each row's interval begins, metres, not rising from row to row.
            end_m: (R, W) depth at which it ends, metres.
        """
        bins = np.arange(int(self.settings.max_range_m / self.bin_m) + 2, dtype=np.int16)
        first = np.rint(start_m[:, 0] / self.bin_m).astype(np.int32)
        last = np.rint(end_m / self.bin_m).astype(np.int16)
        # The rows that have begun at a bin are the lowest ones: the farthest end of those rows decides.
        farthest = np.maximum.accumulate(last[::-1], axis=0)
        farthest = np.concatenate([np.zeros((1, last.shape[1]), np.int16), farthest])
        begun = np.searchsorted(first[::-1], bins, side="right")
        ahead, column = np.nonzero(farthest[begun] > bins[:, None])
        return self._to_world((ahead + np.float32(0.5)).astype(np.float32) * self.bin_m, column)

    def _to_world(self, ahead_m: NDArray[np.float32], column: NDArray[np.integer]) -> "_Points":
        """World x and z of points at a depth on image columns."""
        heading_rad = heading_of(self.pose)
        cos, sin = np.float32(np.cos(heading_rad)), np.float32(np.sin(heading_rad))
        right_m = self.side[column] * ahead_m
        x = np.float32(self.pose[0, 3]) + cos * right_m - sin * ahead_m
        z = np.float32(self.pose[2, 3]) - sin * right_m - cos * ahead_m
        return x, z


_Points = tuple[NDArray[np.float32], NDArray[np.float32]]
"""(N,) x and (N,) z of floor points, metres, world frame."""


def _corners(points: _Points) -> NDArray[np.float64]:
    """The two corners (2, 2) of the box around points; none (0, 2) for none."""
    if len(points[0]) == 0:
        return np.zeros((0, 2))
    return np.array([[axis.min() for axis in points], [axis.max() for axis in points]], np.float64)


def _growth(missing: NDArray[np.int_]) -> NDArray[np.int_]:
    """Round missing cells up to whole blocks; none for none."""
    return np.maximum(0, -(-missing // GROWTH_CELLS)) * GROWTH_CELLS
