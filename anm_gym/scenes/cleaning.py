"""Repair of raw triangles: what cannot be drawn or stood on is dropped, counted and reported."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.reading import RawMesh

_MIN_SINE = 1e-9


@dataclass(frozen=True, eq=False)
class CleanMesh:
    """A mesh that every other module can use, and what it took to get there."""

    mesh: TriangleMesh
    """The sound triangles."""
    num_nan_vertices: int = 0
    """Vertices of the file that were NaN or infinite."""
    num_degenerate_faces: int = 0
    """Faces of the file without area."""
    repairs: tuple[str, ...] = ()
    """One sentence for each repair."""


def clean_mesh(raw: RawMesh, name: str | Path) -> CleanMesh:
    """Drop the faces that touch a vertex that is not finite, and those without area.

    Args:
        raw: Triangles as read, in any unit.
        name: What to call the mesh in messages.

    Returns:
        The sound part, its vertices renumbered without the unused ones.

    Raises:
        SceneError: If a face names a vertex that is not there, or if no sound face is left.
    """
    if raw.faces.min() < 0 or raw.faces.max() >= len(raw.vertices):
        raise SceneError(
            f"every face of {name} must name one of its {len(raw.vertices)} vertices, "
            f"got index {raw.faces.max()}; the file is damaged: export it again"
        )
    is_finite_vertex = np.asarray(np.isfinite(raw.vertices).all(axis=1))
    is_finite = np.asarray(is_finite_vertex[raw.faces].all(axis=1))
    if not is_finite.any():
        raise SceneError(
            f"{name} must have finite vertices, got NaN or infinity in every face; export it again"
        )
    is_flat = is_finite & ~_has_area(raw, is_finite)
    kept = is_finite & ~is_flat
    if not kept.any():
        raise SceneError(f"{name} must have a triangle with area, got only degenerate ones; export it again")
    repairs = _sentences(int((~is_finite).sum()), int(is_flat.sum()))
    return CleanMesh(_compacted(raw, kept), int((~is_finite_vertex).sum()), int(is_flat.sum()), repairs)


def _has_area(raw: RawMesh, is_finite: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(F,) whether the two first edges span an area, judged by their angle so that any unit works."""
    has_area = np.zeros(len(raw.faces), np.bool_)
    first, second, third = raw.vertices[raw.faces[is_finite]].transpose(1, 0, 2)
    to_second, to_third = second - first, third - first
    lengths = np.linalg.norm(to_second, axis=1) * np.linalg.norm(to_third, axis=1)
    has_area[is_finite] = np.linalg.norm(np.cross(to_second, to_third), axis=1) > _MIN_SINE * lengths
    return has_area


def _compacted(raw: RawMesh, kept: NDArray[np.bool_]) -> TriangleMesh:
    faces = raw.faces[kept]
    is_used = np.zeros(len(raw.vertices), np.bool_)
    is_used[faces] = True
    new_index = np.cumsum(is_used) - 1
    colors = None if raw.face_colors is None else raw.face_colors[kept]
    return TriangleMesh(raw.vertices[is_used], new_index[faces].astype(np.int32), colors)


def _sentences(num_not_finite: int, num_flat: int) -> tuple[str, ...]:
    sentences = []
    if num_not_finite:
        sentences.append(f"dropped {num_not_finite} faces with a NaN or infinite vertex")
    if num_flat:
        sentences.append(f"dropped {num_flat} degenerate faces (no area)")
    return tuple(sentences)
