"""Depth by Embree, called directly: exact, robust, no GL, nearly independent of the mesh's size.

The wrapper of trimesh is left out: it converts to float64 and intersects planes again, at three times
the cost.
"""

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anm_gym.errors import BackendError
from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.camera import DepthCamera, RayHits, check_poses, check_rays


class EmbreeCamera(DepthCamera):
    """Depth camera on the CPU.

    Args:
        mesh: What there is to see.
        spec: Image size, field of view and limits of depth.
        threads: Threads that share the rays of an image.

    Raises:
        ValueError: If `threads` is less than 1.
        BackendError: If embreex is not installed.
    """

    def __init__(self, mesh: TriangleMesh, spec: CameraSpec, threads: int = 1) -> None:
        super().__init__(spec)
        if threads < 1:
            raise ValueError(f"`threads` must be >= 1, got {threads}")
        self._scene = _build_scene(mesh)
        self._buffers = _RayBuffers()
        self._threads = threads

    def cast(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> RayHits:
        """Find the first triangle on each ray; see `DepthCamera.cast`."""
        check_rays(origins, directions)
        hits = self._scene.run(origins, directions, query="INTERSECT", output=True)
        missed = hits["primID"] < 0
        return RayHits(np.where(missed, np.float32(np.inf), hits["tfar"]), hits["primID"])

    def render(self, world_from_camera: NDArray[np.floating]) -> NDArray[np.float32]:
        """Render planar depth; see `DepthCamera.render`."""
        check_poses(world_from_camera)
        poses = world_from_camera.reshape(-1, 4, 4)
        height_px, width_px = self.spec.height_px, self.spec.width_px
        origins, directions = self._buffers.of((len(poses), height_px, 3 * width_px))
        for pose, image_origins, image_directions in zip(poses, origins, directions, strict=True):
            np.matmul(self._rows, self._ray_terms(pose), out=image_directions)
            image_origins[:] = self._ray_origins(pose)
        depth = self._distances(origins.reshape(-1, 3), directions.reshape(-1, 3))
        depth *= depth <= self.spec.max_depth_m  # a miss is 1e37
        if self.spec.min_depth_m > 0.0:
            depth *= depth >= self.spec.min_depth_m
        return depth.reshape(*world_from_camera.shape[:-2], height_px, width_px)

    def _distances(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Cast rays, in parts if there are several threads; they live no longer, as a fork kills them."""
        if self._threads == 1:
            return np.asarray(self._scene.run(origins, directions, query="DISTANCE"))
        parts = (np.array_split(values, self._threads) for values in (origins, directions))
        with ThreadPoolExecutor(self._threads) as pool:
            return np.concatenate(
                list(pool.map(lambda *part: self._scene.run(*part, query="DISTANCE"), *parts))
            )


class _RayBuffers(threading.local):
    """Origins and directions that are kept: fresh ones cost 4 % of a frame in page faults.

    Each thread has its own, as environments share cameras.
    """

    def __init__(self) -> None:
        self._arrays = np.empty((2, 0, 0, 0), np.float32)

    def of(self, shape: tuple[int, int, int]) -> NDArray[np.float32]:
        """Two arrays of a shape, (2, *shape) float32, with anything in them."""
        if self._arrays.shape[1:] != shape:
            self._arrays = np.empty((2, *shape), np.float32)
        return self._arrays


def _build_scene(mesh: TriangleMesh) -> Any:
    try:
        from embreex.mesh_construction import TriangleMesh as EmbreeMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError as error:
        raise BackendError(
            f"depth on the CPU needs embreex, got {error!r}; `pip install embreex`, or choose backend='warp'"
        ) from error
    scene = EmbreeScene()
    EmbreeMesh(scene, mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32))
    return scene
