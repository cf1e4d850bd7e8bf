"""Which depth camera a name stands for; back ends are imported when they are asked for."""

from importlib.util import find_spec

from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.camera import DepthCamera

BACKENDS = ("embree", "warp")
"""Names of the depth cameras."""


def cpu_backend() -> str:
    """Name what casts rays on the CPU: Embree, or Warp where there is no Embree, as on ARM."""
    return "embree" if find_spec("embreex") else "warp"


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
