"""Depth by NVIDIA Warp: one kernel launch for any number of cameras, on CUDA or (slowly) on the CPU.

Needs only the CUDA driver: no EGL, no compiler. The kernels are built once and cached by Warp.
"""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anm_gym.errors import BackendError
from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.camera import DepthCamera, RayHits, check_poses, check_rays

FAR_M = 1e6
"""Length of a ray, metres; beyond it nothing is looked for."""


class WarpCamera(DepthCamera):
    """Depth camera on a CUDA device.

    Args:
        mesh: What there is to see.
        spec: Image size, field of view and limits of depth.
        device: Warp's name of the device: ``"cuda:0"``, ``"cpu"``.

    Raises:
        BackendError: If Warp is not installed or the device does not exist.
    """

    def __init__(self, mesh: TriangleMesh, spec: CameraSpec, device: str = "cuda") -> None:
        super().__init__(spec)
        self._wp = _import_warp()
        self._cast_kernel, self._render_kernel = _kernels()
        try:
            self._device = self._wp.get_device(device)
        except (ValueError, RuntimeError) as error:
            known = ", ".join(str(known) for known in self._wp.get_devices())
            raise BackendError(f"`device` must be one of: {known}, got {device!r}") from error
        points = self._upload(mesh.vertices.astype(np.float32), self._wp.vec3)
        self._mesh = self._wp.Mesh(points, self._upload(mesh.faces.ravel(), self._wp.int32))
        self._x = self._upload(spec.directions[0, :, 0], self._wp.float32)
        self._y = self._upload(spec.directions[:, 0, 1], self._wp.float32)

    def cast(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> RayHits:
        """Find the first triangle on each ray; see `DepthCamera.cast`."""
        check_rays(origins, directions)
        wp = self._wp
        distance = wp.empty(len(origins), dtype=wp.float32, device=self._device)
        triangle = wp.empty(len(origins), dtype=wp.int32, device=self._device)
        rays = [self._upload(values, wp.vec3) for values in (origins, directions)]
        inputs = [self._mesh.id, *rays, FAR_M]
        wp.launch(self._cast_kernel, len(origins), inputs, [distance, triangle], device=self._device)
        return RayHits(distance.numpy(), triangle.numpy())

    def render(self, world_from_camera: NDArray[np.floating]) -> NDArray[np.float32]:
        """Render planar depth; see `DepthCamera.render`."""
        depth: NDArray[np.float32] = self._render_on_device(world_from_camera).numpy()
        return depth if world_from_camera.ndim == 3 else depth[0]

    def render_torch(self, world_from_camera: NDArray[np.floating]) -> Any:
        """Render planar depth that stays on the device.

        Args:
            world_from_camera: (4, 4) or (N, 4, 4) poses.

        Returns:
            Torch tensor (H, W) or (N, H, W) float32 on the camera's device, as `render` gives.
        """
        depth = self._wp.to_torch(self._render_on_device(world_from_camera))
        return depth if world_from_camera.ndim == 3 else depth[0]

    def _render_on_device(self, world_from_camera: NDArray[np.floating]) -> Any:
        check_poses(world_from_camera)
        wp, spec = self._wp, self.spec
        poses = np.ascontiguousarray(world_from_camera.reshape(-1, 4, 4), np.float32)
        shape = (len(poses), spec.height_px, spec.width_px)
        depth = wp.empty(shape, dtype=wp.float32, device=self._device)
        limits = [spec.min_depth_m, spec.max_depth_m]
        inputs = [self._mesh.id, self._upload(poses, wp.mat44), self._x, self._y, *limits]
        wp.launch(self._render_kernel, shape, inputs, [depth], device=self._device)
        return depth

    def _upload(self, values: NDArray[Any], dtype: Any) -> Any:
        return self._wp.array(values, dtype=dtype, device=self._device)


def _import_warp() -> Any:
    try:
        import warp
    except ImportError as error:
        raise BackendError(
            f"the Warp depth camera needs warp-lang, got {error!r}; `pip install warp-lang`"
        ) from error
    return warp


@lru_cache(maxsize=1)
def _kernels() -> tuple[Any, Any]:
    """Define the kernels; inside a function, so that the module can be imported without Warp."""
    wp = _import_warp()

    def cast(mesh: Any, origins: Any, directions: Any, far_m: Any, distance: Any, triangle: Any) -> None:
        ray = wp.tid()
        length = wp.length(directions[ray])
        hit = wp.mesh_query_ray(mesh, origins[ray], directions[ray] / length, far_m)
        distance[ray] = wp.inf
        triangle[ray] = -1
        if hit.result:
            distance[ray] = hit.t / length
            triangle[ray] = hit.face

    def render(mesh: Any, poses: Any, x: Any, y: Any, min_m: Any, max_m: Any, depth: Any) -> None:
        camera, row, column = wp.tid()
        pose = poses[camera]
        direction = wp.transform_vector(pose, wp.vec3(x[column], y[row], -1.0))
        origin = wp.transform_point(pose, wp.vec3(0.0, 0.0, 0.0))
        length = wp.length(direction)
        hit = wp.mesh_query_ray(mesh, origin, direction / length, max_m * length * 1.001)
        depth[camera, row, column] = 0.0
        if hit.result:
            planar_m = hit.t / length
            if planar_m >= min_m and planar_m <= max_m:
                depth[camera, row, column] = planar_m

    # Warp reads the types of a kernel from its annotations; a type checker would not accept them there.
    floats, vectors = wp.array(dtype=wp.float32), wp.array(dtype=wp.vec3)
    rays = {"mesh": wp.uint64, "origins": vectors, "directions": vectors, "far_m": wp.float32}
    cast.__annotations__ = {**rays, "distance": floats, "triangle": wp.array(dtype=wp.int32)}
    render.__annotations__ = {
        "mesh": wp.uint64,
        "poses": wp.array(dtype=wp.mat44),
        "x": floats,
        "y": floats,
        "min_m": wp.float32,
        "max_m": wp.float32,
        "depth": wp.array(dtype=wp.float32, ndim=3),
    }
    return wp.kernel(cast), wp.kernel(render)
