"""What every depth camera can do; back ends cast the rays.

Each back end lives in its own module; `anm_gym.sim.backends` chooses one by name.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec


@dataclass(frozen=True)
class RayHits:
    """First hits of N rays."""

    distance: NDArray[np.float32]
    """(N,) in units of the direction's length; infinite for a miss."""
    triangle: NDArray[np.int32]
    """(N,) face index; -1 for a miss."""


class DepthCamera(ABC):
    """A pinhole camera that sees planar depth.

    Directions are scaled to |z| = 1 in the camera frame, so that the ray parameter is the planar
    depth itself.

    Args:
        spec: Image size, field of view and limits of depth.
    """

    def __init__(self, spec: CameraSpec) -> None:
        self.spec = spec
        x, y = spec.directions[0, :, 0], spec.directions[:, 0, 1]
        self._rows = np.stack([y, np.ones_like(y)], axis=1)
        repeated = np.tile(np.eye(3, dtype=np.float32)[:, None], (1, len(x), 1))
        self._repeat = repeated.reshape(3, -1)
        self._basis = np.concatenate([(repeated * x[:, None]).reshape(3, -1), self._repeat])

    @abstractmethod
    def cast(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> RayHits:
        """Find the first triangle on each of N rays, seen from either side.

        Args:
            origins: (N, 3) float32, metres, world frame.
            directions: (N, 3) float32, world frame, any length.
        """

    @abstractmethod
    def render(self, world_from_camera: NDArray[np.floating]) -> NDArray[np.float32]:
        """Render planar depth.

        Args:
            world_from_camera: (4, 4) or (N, 4, 4) poses.

        Returns:
            (H, W) or (N, H, W) float32 metres, 0 where nothing lies between the spec's limits.

        Raises:
            ValueError: If the poses have another shape.
        """

    def render_triangles(self, world_from_camera: NDArray[np.floating]) -> NDArray[np.int32]:
        """Render the face index of each pixel, (H, W) int32; -1 where nothing is hit at any depth."""
        directions = (self._rows @ self._ray_terms(world_from_camera)).reshape(-1, 3)
        origins = np.tile(self._ray_origins(world_from_camera), (self.spec.height_px, 1)).reshape(-1, 3)
        hits = self.cast(origins, directions)
        return hits.triangle.reshape(self.spec.height_px, self.spec.width_px)

    def _ray_terms(self, world_from_camera: NDArray[np.floating]) -> NDArray[np.float32]:
        """Split the world directions of the rays: `_rows @ terms` is (H, 3 W), x, y, z of each pixel.

        A direction is a term of its row plus a term of its column, so one product of (H, 2) and
        (2, 3 W) makes them all, many times faster than one of (H W, 3) and (3, 3).
        """
        rotation = np.asarray(world_from_camera[:3, :3], np.float32)
        mix = np.zeros((2, 6), np.float32)
        mix[0, 3:] = rotation[:, 1]
        mix[1, :3], mix[1, 3:] = rotation[:, 0], -rotation[:, 2]
        return np.asarray(mix @ self._basis)

    def _ray_origins(self, world_from_camera: NDArray[np.floating]) -> NDArray[np.float32]:
        """Repeat the camera's centre for each ray of an image row, (3 W,)."""
        return np.asarray(world_from_camera[:3, 3].astype(np.float32) @ self._repeat)


def check_rays(origins: NDArray[np.float32], directions: NDArray[np.float32]) -> None:
    """Check that rays are two (N, 3) float32 arrays in C order, as the back ends read their memory.

    Raises:
        ValueError: If they are not.
    """
    for name, values in (("origins", origins), ("directions", directions)):
        is_read = values.dtype == np.float32 and values.flags.c_contiguous
        if values.shape != (len(origins), 3) or not is_read:
            raise ValueError(
                f"`{name}` must be ({len(origins)}, 3) float32 in C order, got {values.shape} {values.dtype}"
                "; call `np.ascontiguousarray`"
            )


def check_poses(world_from_camera: NDArray[np.floating]) -> None:
    """Check that poses are (4, 4) or (N, 4, 4).

    Raises:
        ValueError: If they are not.
    """
    if world_from_camera.ndim not in {2, 3} or world_from_camera.shape[-2:] != (4, 4):
        shape = world_from_camera.shape
        raise ValueError(f"`world_from_camera` must have shape (4, 4) or (N, 4, 4), got {shape}")
