"""The reconstructed surface as a coloured PLY and as a dollhouse picture, both without a display."""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.backends import make_depth_camera

LIGHT: Final = np.array([0.35, 0.85, 0.40]) / np.linalg.norm([0.35, 0.85, 0.40])
"""Direction towards the light of the shaded pictures, world frame."""

CUT_ABOVE_FLOOR_M: Final = 1.9
"""Height above the floor at which pictures of a storey are cut open, metres (ours)."""

_STOPS: Final = np.array(
    [[232, 228, 216], [178, 206, 206], [98, 158, 187], [62, 100, 156], [58, 62, 115]], np.float64
)
_HFOV_DEG: Final = 36.0
_WIDTH_PX: Final = 1000
_MARGIN_PX: Final = 24


def height_colors(heights_m: NDArray[np.floating], low_m: float, high_m: float) -> NDArray[np.uint8]:
    """Colour heights from sand (low) to dark blue (high).

    Args:
        heights_m: (N,) heights, metres.
        low_m: Height of the first colour.
        high_m: Height of the last colour.

    Returns:
        (N, 3) uint8 RGB.
    """
    share = np.clip((heights_m - low_m) / max(high_m - low_m, 1e-6), 0.0, 1.0) * (len(_STOPS) - 1)
    channels = [np.interp(share, np.arange(len(_STOPS)), _STOPS[:, channel]) for channel in range(3)]
    return np.stack(channels, axis=-1).round().astype(np.uint8)


def save_ply(path: Path, mesh: TriangleMesh) -> Path:
    """Write the mesh as a PLY whose vertices are coloured by height."""
    import trimesh

    heights = mesh.vertices[:, 1]
    low, high = np.percentile(heights, [1, 99])
    colors = height_colors(heights, float(low), float(high))
    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=colors, process=False).export(path)
    return path


def dollhouse_picture(mesh: TriangleMesh, cut_y_m: float) -> NDArray[np.uint8]:
    """Look down into the mesh, cut open at a height, shaded by its normals and coloured by height.

    Faces that show their back are left out: a near wall of a reconstructed room hides nothing.

    Args:
        mesh: A surface whose faces look into free space.
        cut_y_m: Height above which nothing is drawn, metres, world frame.

    Returns:
        (H, W, 3) uint8 RGB on white, cropped to what there is.
    """
    low, high = mesh.bounds
    high = np.array([high[0], min(high[1], cut_y_m), high[2]])
    pose = _look_at(0.5 * (low + high), high - low)
    towards_eye = pose[:3, 3] - mesh.triangles.mean(axis=1)
    keep = (np.einsum("ij,ij->i", mesh.normals, towards_eye) > 0.0) & (
        mesh.triangles[..., 1].min(axis=1) < cut_y_m
    )
    if not keep.any():
        return np.full((_MARGIN_PX, _MARGIN_PX, 3), 255, np.uint8)
    return _crop(_draw(TriangleMesh(mesh.vertices, mesh.faces[keep]), pose, cut_y_m))


def _draw(mesh: TriangleMesh, pose: NDArray[np.float64], cut_y_m: float) -> NDArray[np.uint8]:
    """Cast the rays of a picture from the plane of the cut; four rays are averaged for each pixel."""
    side_px = 2 * _WIDTH_PX
    spec = CameraSpec(side_px, side_px, hfov_deg=_HFOV_DEG)
    directions = (spec.directions.reshape(-1, 3).astype(np.float64) @ pose[:3, :3].T).astype(np.float32)
    to_cut = np.clip((cut_y_m - pose[1, 3]) / directions[:, 1:2], 0.0, None)
    origins = (pose[:3, 3] + to_cut * directions).astype(np.float32)
    hits = make_depth_camera(mesh, spec).cast(origins, directions)
    is_hit = hits.triangle >= 0
    heights = origins[is_hit, 1] + hits.distance[is_hit] * directions[is_hit, 1]
    normals = mesh.normals[hits.triangle[is_hit]]
    light = 0.62 + 0.38 * np.clip(normals @ LIGHT, -0.5, 1.0)
    picture = np.full((len(directions), 3), 255.0)
    picture[is_hit] = height_colors(heights, cut_y_m - CUT_ABOVE_FLOOR_M, cut_y_m) * light[:, None]
    fine = picture.reshape(_WIDTH_PX, 2, _WIDTH_PX, 2, 3)
    return np.asarray(fine.mean(axis=(1, 3)).round(), np.uint8)


def _crop(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Cut off the white border but for a margin."""
    rows, columns = (np.flatnonzero((picture < 255).any(axis=(axis, 2))) for axis in (1, 0))
    if not len(rows):
        return picture
    spans = [slice(max(span[0] - _MARGIN_PX, 0), span[-1] + 1 + _MARGIN_PX) for span in (rows, columns)]
    return picture[spans[0], spans[1]]


def _look_at(center: NDArray[np.float64], extent: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pose that looks down steeply at a box, from +z as the map's lower edge, with all of it in view."""
    back = np.array([0.0, 1.0, 0.45]) / np.hypot(1.0, 0.45)
    right = np.array([1.0, 0.0, 0.0])
    half_m = 0.5 * float(max(extent[0], extent[2]))
    distance_m = half_m / np.tan(np.deg2rad(_HFOV_DEG / 2.0)) + 0.3 * float(np.linalg.norm(extent))
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(back, right), back], axis=1)
    pose[:3, 3] = center + 1.05 * distance_m * back
    return pose
