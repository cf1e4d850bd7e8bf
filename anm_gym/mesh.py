"""The triangle mesh that every floor above shares: plain arrays, checked once.

Loading, repair and reports are the business of `anm_gym.scenes`.
"""

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anm_gym.errors import SceneError


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles in the world frame.

    Raises:
        SceneError: If there is no triangle, an array has another shape, a vertex is not finite or
            a face names a vertex that does not exist.
    """

    vertices: NDArray[np.float64]
    """(V, 3) float64, metres, world frame (y up)."""
    faces: NDArray[np.int32]
    """(F, 3) int32 indices into `vertices`."""
    face_colors: NDArray[np.uint8] | None = None
    """(F, 3) uint8 RGB of each face; None paints by normal."""

    def __post_init__(self) -> None:
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3:
            raise SceneError(f"`vertices` must have shape (V, 3), got {self.vertices.shape}")
        if self.faces.ndim != 2 or self.faces.shape[1] != 3:
            raise SceneError(f"`faces` must have shape (F, 3), got {self.faces.shape}")
        if len(self.faces) == 0:
            raise SceneError("the mesh must have at least one triangle, got 0; is the file empty?")
        if not np.isfinite(self.vertices).all():
            raise SceneError("every vertex must be finite, got NaN or infinity; load it with `load_scene`")
        lowest, highest = int(self.faces.min()), int(self.faces.max())
        if lowest < 0 or highest >= len(self.vertices):
            wrong = lowest if lowest < 0 else highest
            raise SceneError(f"`faces` must index the {len(self.vertices)} vertices, got {wrong}")
        if self.face_colors is not None and self.face_colors.shape != self.faces.shape:
            raise SceneError(
                f"`face_colors` must have shape {self.faces.shape}, one colour per face, "
                f"got {self.face_colors.shape}"
            )

    @cached_property
    def triangles(self) -> NDArray[np.float64]:
        """(F, 3, 3) float64 corner positions, metres."""
        return self.vertices[self.faces]

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        """(F, 3) float64 unit face normals by winding; zero for a degenerate face."""
        cross = self._cross
        length = np.linalg.norm(cross, axis=1, keepdims=True)
        return np.asarray(np.divide(cross, length, out=np.zeros_like(cross), where=length > 0))

    @cached_property
    def areas_m2(self) -> NDArray[np.float64]:
        """(F,) float64 face areas, square metres."""
        return np.asarray(0.5 * np.linalg.norm(self._cross, axis=1))

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) float64 lowest and highest corner over the faces' vertices, metres."""
        corners = self.triangles.reshape(-1, 3)
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    @cached_property
    def content_hash(self) -> str:
        """Sixteen hexadecimal digits that name the geometry."""
        digest = hashlib.sha256(np.ascontiguousarray(self.vertices).tobytes())
        digest.update(np.ascontiguousarray(self.faces).tobytes())
        return digest.hexdigest()[:16]

    @property
    def _cross(self) -> NDArray[np.float64]:
        first, second, third = self.triangles.transpose(1, 0, 2)
        return np.cross(second - first, third - first)
