"""Frames, headings and the pinhole camera: the few formulas that every floor shares.

World frame: right-handed, y up, metres. Heading: counter-clockwise about +y, radians, 0 looks along
-z. Camera frame: x right, y up, looking along -z (OpenGL). Pixel centres lie at +0.5.
"""

from dataclasses import dataclass
from functools import lru_cache
from numbers import Integral, Real

import numpy as np
from numpy.typing import ArrayLike, NDArray

LARGEST_DEPTH_M = 10_000.0
"""No camera sees farther, metres: beyond, single precision no longer tells centimetres apart."""

RIGID_TOLERANCE = 5e-3
"""How far the products of a rotation's axes may be from those of a true one."""


@dataclass(frozen=True)
class CameraSpec:
    """A pinhole depth camera on the agent.

    Raises:
        TypeError: If a field is no number, or a size no whole one.
        ValueError: If a field is out of its range.

    Source:
        Active Neural Mapping, Sec. 5.1: 256 x 256 pixels, 90 degrees, 1.25 m above the floor.
    """

    width_px: int = 256
    """Image width, pixels."""
    height_px: int = 256
    """Image height, pixels."""
    hfov_deg: float = 90.0
    """Horizontal field of view, degrees."""
    sensor_height_m: float = 1.25
    """Height of the camera above the floor, metres."""
    min_depth_m: float = 0.0
    """Planar depth under which a pixel counts as empty (0), metres."""
    max_depth_m: float = 10.0
    """Planar depth beyond which a pixel counts as empty (0), metres (Habitat's default)."""

    def __post_init__(self) -> None:
        for name in ("width_px", "height_px"):
            if not isinstance(getattr(self, name), Integral):
                raise TypeError(f"`{name}` must be a whole number of pixels, got {getattr(self, name)!r}")
        for name in ("hfov_deg", "sensor_height_m", "min_depth_m", "max_depth_m"):
            if not isinstance(getattr(self, name), Real):
                raise TypeError(f"`{name}` must be a number, got {getattr(self, name)!r}")
        if self.width_px < 1 or self.height_px < 1:
            raise ValueError(
                f"`width_px` and `height_px` must be >= 1, got {self.width_px} x {self.height_px}"
            )
        if not 0.0 < self.hfov_deg < 180.0:
            raise ValueError(f"`hfov_deg` must be between 0 and 180, got {self.hfov_deg}")
        if not 0.0 < self.sensor_height_m < float("inf"):
            raise ValueError(f"`sensor_height_m` must be > 0 and finite, got {self.sensor_height_m}")
        if not 0.0 <= self.min_depth_m < self.max_depth_m:
            raise ValueError(
                f"`min_depth_m` must be in [0, max_depth_m), got {self.min_depth_m} of {self.max_depth_m}"
            )
        if self.max_depth_m > LARGEST_DEPTH_M:
            raise ValueError(
                f"`max_depth_m` must be at most {LARGEST_DEPTH_M:g}, got {self.max_depth_m}; "
                "a pixel that shows nothing is 0, however far the camera sees"
            )

    @property
    def focal_px(self) -> float:
        """Focal length in pixels, the same along both axes."""
        return float(0.5 * self.width_px / np.tan(np.deg2rad(self.hfov_deg) / 2.0))

    @property
    def directions(self) -> NDArray[np.float32]:
        """(H, W, 3) float32 ray of each pixel in the camera frame, scaled to z = -1 (read-only)."""
        return _pixel_directions(self.width_px, self.height_px, self.focal_px)


@lru_cache(maxsize=32)
def _pixel_directions(width_px: int, height_px: int, focal_px: float) -> NDArray[np.float32]:
    x = (np.arange(width_px) + 0.5 - width_px / 2.0) / focal_px
    y = (height_px / 2.0 - np.arange(height_px) - 0.5) / focal_px
    directions = np.empty((height_px, width_px, 3), np.float32)
    directions[..., 0] = x[None, :]
    directions[..., 1] = y[:, None]
    directions[..., 2] = -1.0
    directions.flags.writeable = False
    return directions


def wrap_angle(angle_rad: float) -> float:
    """Bring an angle into [-pi, pi), radians."""
    return float((angle_rad + np.pi) % (2.0 * np.pi) - np.pi)


def wrap_angles(angles_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bring angles of any shape into [-pi, pi), radians."""
    return np.asarray((angles_rad + np.pi) % (2.0 * np.pi) - np.pi)


def forward_xz(heading_rad: float) -> NDArray[np.float64]:
    """Unit vector (x, z) of a heading: 0 looks along -z, pi/2 (left) along -x."""
    return np.array([-np.sin(heading_rad), -np.cos(heading_rad)])


def heading_towards(from_xz: ArrayLike, to_xz: ArrayLike) -> float:
    """Heading, radians, that looks from one floor point (x, z) to another."""
    delta = np.asarray(to_xz, np.float64) - np.asarray(from_xz, np.float64)
    return float(np.arctan2(-delta[0], -delta[1]))


def camera_pose(position: ArrayLike, heading_rad: float) -> NDArray[np.float64]:
    """Build `world_from_camera` of a level camera.

    Args:
        position: (3,) camera centre, metres, world frame.
        heading_rad: Heading, radians.

    Returns:
        (4, 4) float64 rigid transform.
    """
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    pose = np.eye(4)
    pose[:3, :3] = [[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]]
    pose[:3, 3] = np.asarray(position, np.float64)
    return pose


def check_rigid(world_from_camera: NDArray[np.floating]) -> None:
    """Refuse what is not the pose of a camera, (4, 4): a rotation and a place, neither scaled nor mirrored.

    Raises:
        ValueError: If it is of another shape, not finite, or not rigid.
    """
    pose = np.asarray(world_from_camera)
    if pose.shape != (4, 4) or not np.isfinite(pose).all():
        raise ValueError(f"`world_from_camera` must be a finite 4 x 4 pose, got {pose}")
    rotation = pose[:3, :3].astype(np.float64)
    is_rotation = (
        np.abs(rotation @ rotation.T - np.eye(3)).max() < RIGID_TOLERANCE and np.linalg.det(rotation) > 0
    )
    if not is_rotation or np.abs(pose[3] - (0.0, 0.0, 0.0, 1.0)).max() > RIGID_TOLERANCE:
        raise ValueError(
            "`world_from_camera` must hold a rotation, a place and a last row of 0, 0, 0, 1, got "
            f"{pose.tolist()}; is it scaled, mirrored or transposed?"
        )


def heading_of(world_from_camera: NDArray[np.floating]) -> float:
    """Heading, radians, of a camera pose (4, 4)."""
    return float(np.arctan2(world_from_camera[0, 2], world_from_camera[2, 2]))


def pointgoal(from_xz: ArrayLike, heading_rad: float, goal_xz: ArrayLike) -> NDArray[np.float32]:
    """Habitat's polar goal: (2,) float32 of distance (m) and bearing (rad, left positive)."""
    delta = np.asarray(goal_xz, np.float64) - np.asarray(from_xz, np.float64)
    distance_m = float(np.hypot(*delta))
    bearing_rad = wrap_angle(heading_towards(from_xz, goal_xz) - heading_rad) if distance_m > 0 else 0.0
    return np.array([distance_m, bearing_rad], np.float32)


def backproject(
    depth_m: NDArray[np.float32], spec: CameraSpec, world_from_camera: NDArray[np.floating]
) -> NDArray[np.float32]:
    """Turn a planar depth image into world points.

    Args:
        depth_m: (H, W) or (H, W, 1) float32 planar depth, metres; 0 is empty.
        spec: The camera that took it.
        world_from_camera: (4, 4) pose.

    Returns:
        (N, 3) float32 points of the N non-empty pixels in row order, metres, world frame.
    """
    depth = depth_m.reshape(spec.height_px, spec.width_px)
    seen = depth > 0.0
    points = spec.directions[seen] * depth[seen, None]
    rotation = world_from_camera[:3, :3].astype(np.float32)
    return np.asarray(points @ rotation.T + world_from_camera[:3, 3].astype(np.float32), np.float32)
