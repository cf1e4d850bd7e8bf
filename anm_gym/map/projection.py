"""Depth seen from above: the projections that published grid baselines feed to their networks.

`OccupancyGrid` is the suite's own map, with holes, carving and contacts, and what navigators plan on;
here points are only sorted by height and counted, as the baselines do it, on a raster of any pose.
"""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from anm_gym.checks import check_at_least, check_choices
from anm_gym.geometry import CameraSpec
from anm_gym.map.occupancy import check_level
from anm_gym.sim.grid import GridFrame

FreeRule = Literal["floor", "not_obstacle"]
VOID: Final = 0
"""Class of a cell that holds nothing or was not seen."""
OCCUPIED: Final = 1
"""Class of a cell with an obstacle."""
FREE: Final = 2
"""Class of a cell with floor."""
NUM_CLASSES: Final = 3
PSEUDO_COUNT: Final = 1.0 / NUM_CLASSES
"""What a class without any point counts in a cell (UPEN)."""
_WIDE = np.ones((5, 5), bool)
_NARROW = np.ones((3, 3), bool)


@dataclass(frozen=True)
class ProjectionSettings:
    """Which depth counts, and what a height means."""

    min_depth_m: float = 0.0
    """Planar depth that a point must exceed, metres."""
    max_depth_m: float = 3.0
    """Largest planar depth of a point, metres."""
    obstacle_min_m: float = 0.25
    """Lowest obstacle above the floor, metres."""
    obstacle_max_m: float = 1.5
    """Highest obstacle above the floor, metres; what is higher is passed under."""
    free_rule: FreeRule = "floor"
    """`floor`: points under the lowest obstacle are free; `not_obstacle`: those above the highest too."""
    obstacle_growths: int = 0
    """Times that obstacle masks are dilated by 3 x 3 cells."""
    free_growths: int = 0
    """Times that free masks are dilated by 5 x 5 cells."""
    min_points: int = 1
    """Points that make a cell count in a mask."""
    fills_holes: bool = False
    """Give empty pixels the largest depth of their image column."""
    pixels_used: int = 128
    """Rows and columns of the image that are looked at, at most."""

    def __post_init__(self) -> None:
        check_choices(self)
        if not 0.0 <= self.min_depth_m < self.max_depth_m:
            raise ValueError(
                f"`min_depth_m` must be in [0, max_depth_m), got {self.min_depth_m} of {self.max_depth_m}"
            )
        if not 0.0 < self.obstacle_min_m < self.obstacle_max_m:
            raise ValueError(
                "`obstacle_min_m` must be in (0, obstacle_max_m), "
                f"got {self.obstacle_min_m} of {self.obstacle_max_m}"
            )
        check_at_least(self, 0, "obstacle_growths", "free_growths")
        check_at_least(self, 1, "min_points", "pixels_used")


PRESETS: Final = {
    "upen": ProjectionSettings(min_depth_m=0.5, max_depth_m=3.0, obstacle_min_m=0.25, obstacle_max_m=2.25),
    "occant": ProjectionSettings(
        max_depth_m=3.25, obstacle_min_m=0.2, obstacle_max_m=1.5, obstacle_growths=2, free_growths=2
    ),
    "ans": ProjectionSettings(
        max_depth_m=3.2,
        obstacle_min_m=0.25,
        obstacle_max_m=1.5,
        free_rule="not_obstacle",
        fills_holes=True,
    ),
}
"""As published code projects: UPEN, OccAnt (policy input) and Active Neural SLAM. All use true pixel
centres here, where the originals are off by up to half a pixel, and at most 128 rows and columns."""


@dataclass(frozen=True, eq=False)
class FloorHits:
    """Points of a depth image, dropped on the floor."""

    points_xz: NDArray[np.float32]
    """(N, 2) floor points (x, z), metres; world frame, or the camera's (x right, z back) without a pose."""
    is_occupied: NDArray[np.bool_]
    """(N,) whether the point is an obstacle; else it is free floor."""


def project_depth(
    depth_m: NDArray[np.float32],
    camera: CameraSpec,
    settings: ProjectionSettings,
    world_from_camera: NDArray[np.floating] | None = None,
) -> FloorHits:
    """Sort the points of a depth image by height.

    Args:
        depth_m: (H, W) or (H, W, 1) float32 planar depth, metres; 0 is empty.
        camera: The level camera that took it, `sensor_height_m` above the floor.
        settings: What counts.
        world_from_camera: (4, 4) pose; None leaves the points in the frame of the camera.

    Raises:
        ValueError: If the camera is not level.

    Source:
        UPEN, OccAnt and Active Neural SLAM as `PRESETS` tells.
    """
    if world_from_camera is not None:
        check_level(world_from_camera)
    rows, columns = _lines(camera.height_px, settings), _lines(camera.width_px, settings)
    depth = depth_m.reshape(camera.height_px, camera.width_px)[rows, columns]
    if settings.fills_holes:
        depth = np.where(depth > 0.0, depth, depth.max(axis=0, keepdims=True))
    height_m = camera.directions[rows, 0, 1][:, None] * depth + np.float32(camera.sensor_height_m)
    is_occupied = (height_m > settings.obstacle_min_m) & (height_m < settings.obstacle_max_m)
    is_used = (depth > settings.min_depth_m) & (depth <= settings.max_depth_m)
    if settings.free_rule == "floor":
        is_used &= height_m < settings.obstacle_max_m
    pixel = np.flatnonzero(is_used)
    ahead_m = depth.ravel()[pixel]
    right_m = camera.directions[0, columns, 0][pixel % depth.shape[1]] * ahead_m
    return FloorHits(_on_floor(right_m, ahead_m, world_from_camera), is_occupied.ravel()[pixel])


def count_hits(hits: FloorHits, frame: GridFrame) -> NDArray[np.int32]:
    """Count points by cell, (2, rows, columns) int32: obstacles, free; points beyond the raster are dropped.

    Args:
        hits: The points.
        frame: The raster, in the frame of the points.
    """
    size = frame.shape[0] * frame.shape[1]
    scaled = (hits.points_xz - np.asarray(frame.origin_xz, np.float32)) * np.float32(1.0 / frame.cell_m)
    cells = np.floor(scaled).astype(np.int32)
    column, row = cells[:, 0], cells[:, 1]
    inside = (row >= 0) & (row < frame.shape[0]) & (column >= 0) & (column < frame.shape[1])
    flat = row * np.int32(frame.shape[1]) + column + np.where(hits.is_occupied, 0, size).astype(np.int32)
    return np.bincount(flat[inside], minlength=2 * size).reshape(2, *frame.shape).astype(np.int32)


def class_probabilities(counts: NDArray[np.int32]) -> NDArray[np.float32]:
    """Turn counts into probabilities of `VOID`, `OCCUPIED` and `FREE`, (3, rows, columns) float32.

    A class without a point counts a third, so a cell with one obstacle point is 0.2, 0.6, 0.2 and one
    without any is uniform.

    Args:
        counts: (2, rows, columns) of `count_hits`.

    Source:
        UPEN's released code.
    """
    weights = np.full((NUM_CLASSES, *counts.shape[1:]), PSEUDO_COUNT, np.float32)
    weights[OCCUPIED:][counts > 0] = counts[counts > 0]
    return np.asarray(weights / weights.sum(axis=0), np.float32)


def seen_masks(counts: NDArray[np.int32], settings: ProjectionSettings) -> NDArray[np.bool_]:
    """Turn counts into masks of what is occupied and what is explored, (2, rows, columns) bool.

    Args:
        counts: (2, rows, columns) of `count_hits`.
        settings: How many points count, and how often masks are grown.

    Source:
        OccAnt's and Active Neural SLAM's released code.
    """
    occupied, free = counts >= settings.min_points
    if settings.obstacle_growths:
        occupied = ndimage.binary_dilation(occupied, _NARROW, settings.obstacle_growths)
    if settings.free_growths:
        free = ndimage.binary_dilation(free, _WIDE, settings.free_growths)
    return np.stack([occupied, occupied | free])


def _lines(size_px: int, settings: ProjectionSettings) -> slice:
    """Evenly spaced rows or columns."""
    stride = -(-size_px // settings.pixels_used)
    return slice((stride - 1) // 2, None, stride)


def _on_floor(
    right_m: NDArray[np.float32], ahead_m: NDArray[np.float32], world_from_camera: NDArray[np.floating] | None
) -> NDArray[np.float32]:
    points = np.stack([right_m, -ahead_m], axis=1)
    if world_from_camera is None:
        return points
    turn = world_from_camera[np.ix_([0, 2], [0, 2])].astype(np.float32)
    return np.asarray(points @ turn.T + world_from_camera[[0, 2], 3].astype(np.float32))
