"""What every depth camera can do; back ends cast the rays.

Each back end lives in its own module, which is imported when it is asked for.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh

BACKENDS = ("embree", "warp")


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
        self._columns = np.stack([x, -np.ones_like(x)], axis=1)
        self._rows = np.stack([y, np.ones_like(y)], axis=1)

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
        directions = np.empty((self.spec.height_px * self.spec.width_px, 3), np.float32)
        self._fill_directions(world_from_camera, directions)
        origins = np.empty_like(directions)
        self._fill_origins(world_from_camera, origins)
        hits = self.cast(origins, directions)
        return hits.triangle.reshape(self.spec.height_px, self.spec.width_px)

    def _fill_directions(self, world_from_camera: NDArray[np.floating], out: NDArray[np.float32]) -> None:
        """Write the world direction of every pixel to (H * W, 3).

        A direction is a term of its column plus a term of its row, so one product of (H, 2) and
        (2, 3 W) makes them all; a product with (H * W, 3) costs several times as much.
        """
        rotation = np.asarray(world_from_camera[:3, :3], np.float32)
        terms = np.empty((2, len(self._columns), 3), np.float32)
        terms[0] = rotation[:, 1]
        np.matmul(self._columns, rotation[:, [0, 2]].T, out=terms[1])
        np.matmul(self._rows, terms.reshape(2, -1), out=out.reshape(self.spec.height_px, -1))

    def _fill_origins(self, world_from_camera: NDArray[np.floating], out: NDArray[np.float32]) -> None:
        """Write the camera's centre to every row of (H * W, 3), an image row at a time."""
        center = np.asarray(world_from_camera[:3, 3], np.float32)
        out.reshape(self.spec.height_px, -1)[:] = np.tile(center, self.spec.width_px)


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


def make_depth_camera(
    mesh: TriangleMesh, spec: CameraSpec, *, backend: str = "embree", device: str = "cpu", threads: int = 1
) -> DepthCamera:
    """Build a depth camera over a mesh.

    Args:
        mesh: What there is to see.
        spec: Image size, field of view and limits of depth.
        backend: ``"embree"`` (CPU) or ``"warp"`` (CUDA, or its slow CPU twin).
        device: Where a ``"warp"`` camera runs, such as ``"cuda:0"``; Embree has only ``"cpu"``.
        threads: Threads that share the rays of an ``"embree"`` image; one per process is best when
            several environments run.

    Returns:
        The camera.

    Raises:
        ValueError: If the back end is unknown, or cannot run on the device.
        BackendError: If the back end is not installed.
    """
    if backend == "embree":
        from anm_gym.sim.embree import EmbreeCamera

        if device != "cpu":
            raise ValueError(f"`device` must be 'cpu' for Embree, got {device!r}; choose backend='warp'")
        return EmbreeCamera(mesh, spec, threads)
    if backend == "warp":
        from anm_gym.sim.warp_camera import WarpCamera

        return WarpCamera(mesh, spec, device)
    raise ValueError(f"unknown depth backend {backend!r}; choose one of: {', '.join(BACKENDS)}")
