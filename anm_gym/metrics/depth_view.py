"""A depth frame as the metrics see it: range filter, optional thinning, and the pinhole in pixel indices."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec

MIN_DEPTH_M = 0.07
"""Planar depth below which a pixel counts as empty, metres (released code of Active Neural Mapping)."""

MAX_DEPTH_M = 8.0
"""Planar depth above which a pixel counts as empty, metres (released code of Active Neural Mapping)."""


@dataclass(frozen=True, eq=False)
class DepthView:
    """A grid of depth pixels and where it was taken from.

    A camera-frame point (x, y, z) with ``depth = -z`` falls on the real-valued pixel index
    ``column = focal * x / depth + center_column``, ``row = center_row - focal * y / depth``;
    whole numbers are pixel centres.
    """

    depth_m: NDArray[np.float32]
    """(H, W) float32 planar depth, metres; 0 is empty."""
    directions: NDArray[np.float32]
    """(H, W, 3) float32 rays in the camera frame with z = -1."""
    focal: float
    """Focal length in grid pixels."""
    center_column: float
    """Index of the column under the optical axis."""
    center_row: float
    """Index of the row under the optical axis."""
    world_from_camera: NDArray[np.float64]
    """(4, 4) float64 pose."""

    @cached_property
    def is_valid(self) -> NDArray[np.bool_]:
        """(H, W) bool: which pixels hold a depth."""
        return self.depth_m > 0.0

    @cached_property
    def points(self) -> NDArray[np.float32]:
        """(N, 3) float32 points of the pixels that hold a depth, metres, world frame."""
        pose = self.world_from_camera.astype(np.float32)
        across, up = self.directions[:1, :, 0], self.directions[:, :1, 1]
        rays = (pose[axis, 0] * across + (pose[axis, 1] * up - pose[axis, 2]) for axis in range(3))
        points = np.stack([(ray * self.depth_m).ravel() for ray in rays]) + pose[:3, 3:]
        return (points if self.is_valid.all() else points[:, self.is_valid.ravel()]).T

    def thinned(self, max_side_px: int) -> "DepthView":
        """Keep every n-th pixel of every n-th row, from the first on, until no side exceeds `max_side_px`.

        For a whole ratio this is what nearest-neighbour resizing picks; each pixel keeps its own ray.
        """
        stride = -(-max(self.depth_m.shape) // max_side_px)
        if stride == 1:
            return self
        return DepthView(
            np.ascontiguousarray(self.depth_m[::stride, ::stride]),
            self.directions[::stride, ::stride],
            self.focal / stride,
            self.center_column / stride,
            self.center_row / stride,
            self.world_from_camera,
        )


def depth_view(
    depth_m: NDArray[np.float32],
    camera: CameraSpec,
    world_from_camera: NDArray[np.floating],
    min_depth_m: float = MIN_DEPTH_M,
    max_depth_m: float = MAX_DEPTH_M,
) -> DepthView:
    """Take a frame as the sensor gave it and empty the pixels out of range.

    Args:
        depth_m: (H, W) or (H, W, 1) float32 planar depth, metres; 0 is empty.
        camera: The camera that took it.
        world_from_camera: (4, 4) pose.
        min_depth_m: Nearest depth that counts.
        max_depth_m: Farthest depth that counts.

    Returns:
        The frame at full resolution.

    Raises:
        ValueError: If the image is not of the camera's size.
    """
    shape = (camera.height_px, camera.width_px)
    if depth_m.shape not in (shape, (*shape, 1)):
        raise ValueError(f"`depth_m` must have shape {shape} or {(*shape, 1)}, got {depth_m.shape}")
    depth = np.asarray(depth_m, np.float32).reshape(shape)
    in_range = (depth >= min_depth_m) & (depth <= max_depth_m)
    return DepthView(
        np.where(in_range, depth, np.float32(0.0)),
        camera.directions,
        camera.focal_px,
        camera.width_px / 2.0 - 0.5,
        camera.height_px / 2.0 - 0.5,
        np.asarray(world_from_camera, np.float64),
    )
