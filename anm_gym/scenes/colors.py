"""One colour per face from whatever a mesh file carries: face, vertex, material or texture colours."""

from typing import Any, Final

import numpy as np
import trimesh
from numpy.typing import NDArray

PLAIN_RGB: Final = (200, 200, 200)
"""Colour of a part without one, in a file whose other parts have colours."""


def face_colors_of(part: trimesh.Trimesh) -> NDArray[np.uint8] | None:
    """Reduce the appearance of a mesh to one colour per face.

    Vertex colours are averaged over the three corners; a texture is read at the mean of the
    corners' texture coordinates and tinted by the material.

    Args:
        part: Mesh of F faces as trimesh loads it.

    Returns:
        (F, 3) uint8 RGB, or None if the part has no colour at all.

    Source:
        Ours: depth is what the agent sees, so one colour per face is enough for pictures.
    """
    visual: Any = part.visual
    if visual.kind == "face":
        return np.asarray(visual.face_colors[:, :3], np.uint8)
    if visual.kind == "vertex":
        corners = np.asarray(visual.vertex_colors, np.float32)[part.faces, :3]
        return _to_uint8(corners.mean(axis=1))
    if visual.kind == "texture":
        return _textured(visual, np.asarray(part.faces))
    return None


def _textured(visual: Any, faces: NDArray[np.int64]) -> NDArray[np.uint8]:
    texture = _texture_of(visual.material)
    if texture is None or visual.uv is None or len(visual.uv) == 0:
        return np.tile(_to_uint8(_tint_of(visual.material) * 255.0), (len(faces), 1))
    uv = np.nan_to_num(np.asarray(visual.uv, np.float64)[faces].mean(axis=1))
    texels = np.asarray(trimesh.visual.color.uv_to_color(uv, texture), np.float64)[:, :3]
    return _to_uint8(texels * _tint_of(visual.material))


def _texture_of(material: Any) -> Any:
    texture = getattr(material, "baseColorTexture", None)
    return getattr(material, "image", None) if texture is None else texture


def _tint_of(material: Any) -> NDArray[np.float64]:
    """(3,) factor in [0, 1] by which the material multiplies its texture; white if it names none."""
    color = getattr(material, "baseColorFactor", None)
    color = getattr(material, "diffuse", None) if color is None else color
    if color is None:
        return np.ones(3)
    return np.asarray(trimesh.visual.color.to_rgba(color), np.float64)[:3] / 255.0


def _to_uint8(colors: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Round colours in [0, 255] to uint8; a colour that is not a number becomes black."""
    return np.asarray(np.clip(np.rint(np.nan_to_num(colors)), 0, 255), np.uint8)
