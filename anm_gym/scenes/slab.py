"""The part of a mesh between two heights: triangles that cross a height are cut there."""

import numpy as np
import trimesh
from numpy.typing import NDArray

from anm_gym.mesh import TriangleMesh


def slab_of(mesh: TriangleMesh, low_y_m: float, high_y_m: float) -> TriangleMesh:
    """Keep what of a mesh lies between two heights.

    Args:
        mesh: The mesh.
        low_y_m: The lower height, metres, world frame; -inf cuts nothing.
        high_y_m: The upper height, metres, world frame; inf cuts nothing.

    Returns:
        Triangles that lie between the heights as they are and in their order, then the pieces of those that
        reach beyond, in the colours of their triangles.

    Raises:
        SceneError: If nothing lies between the heights.
    """
    lowest, highest = (extreme(mesh.triangles[:, :, 1], axis=1) for extreme in (np.min, np.max))
    inside = np.flatnonzero((lowest >= low_y_m) & (highest <= high_y_m))
    crossing = np.flatnonzero(
        (highest > low_y_m) & (lowest < high_y_m) & ((lowest < low_y_m) | (highest > high_y_m))
    )
    corners = mesh.triangles[crossing].reshape(-1, 3)
    pieces = np.arange(len(corners)).reshape(-1, 3)
    # Cutting carries texture coordinates along; here they say which triangle a corner comes from.
    origin = np.repeat(crossing, 3)[:, None] * np.ones(2)
    for height_m, up in ((low_y_m, 1.0), (high_y_m, -1.0)):
        if len(pieces) and np.isfinite(height_m):
            corners, pieces, origin = trimesh.intersections.slice_faces_plane(  # type: ignore[no-untyped-call]
                corners, pieces, [0.0, up, 0.0], [0.0, height_m, 0.0], uv=origin
            )
    sources = np.concatenate([inside, _origin_of(pieces, origin)])
    faces = np.concatenate([mesh.faces[inside], pieces + len(mesh.vertices)]).astype(np.int32)
    colors = None if mesh.face_colors is None else mesh.face_colors[sources]
    return TriangleMesh(np.concatenate([mesh.vertices, corners]), faces, colors)


def _origin_of(pieces: NDArray[np.integer], origin: NDArray[np.floating]) -> NDArray[np.intp]:
    """(P,) number of the triangle that each piece was cut from."""
    return np.asarray(np.rint(origin[pieces[:, 0], 0]), np.intp)
