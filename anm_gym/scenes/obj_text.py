"""OBJ text in the form that the parser reads rightly: triangles, indices counted from the file's beginning.

The parser cuts polygons into fans, which walls up the door in a wall that is one polygon, and counts negative
indices from the end of the file instead of from where they stand.
"""

import re
from collections.abc import Iterator
from typing import Final

import mapbox_earcut
import numpy as np
from numpy.typing import NDArray

_KINDS: Final = ("v", "vt", "vn")
"""Keywords of positions, texture coordinates and normals, in the order in which a corner names them."""
_NEEDS_CARE: Final = re.compile(rb"^[ \t]*f(?:(?:[ \t]+[^\s#\\]+){5,}|[^\n#]*(?:[ \t/]-\d|\\))", re.M)


def needs_care(data: bytes) -> bool:
    """Whether there are faces of more than four corners, over several lines or with negative indices."""
    return _NEEDS_CARE.search(data) is not None


def plain_obj(text: str) -> str:
    """Rewrite the faces of an OBJ file with positive indices, and those of many corners as triangles.

    Args:
        text: The file's content.

    Returns:
        The same surface: polygons are cut along their own shape, seen along the axis that they face most; all
        else stays.

    Raises:
        ValueError: If a negative index counts back beyond the beginning.
    """
    places: list[list[str]] = []
    counts = dict.fromkeys(_KINDS, 0)
    lines = []
    for line in re.sub(r"\\\r?\n", " ", text).splitlines():
        keyword, *words = line.split("#", 1)[0].split() or [""]
        if keyword in counts:
            counts[keyword] += 1
        if keyword == "v":
            places.append(words[:3])
        if keyword == "f":
            corners = [_absolute(word, counts) for word in words]
            lines += ["f " + " ".join(triangle) for triangle in _triangles(corners, places)]
        else:
            lines.append(line)
    return "\n".join(lines) + "\n"


def _absolute(corner: str, counts: dict[str, int]) -> str:
    """Count the negative indices of a corner, such as `-1/-1`, from the beginning."""
    indices = corner.split("/")
    for place, kind in enumerate(_KINDS[: len(indices)]):
        if indices[place].startswith("-"):
            counted = counts[kind] + 1 + int(indices[place])
            if counted < 1:
                raise ValueError(f"the face corner {corner} counts back beyond the {counts[kind]} so far")
            indices[place] = str(counted)
    return "/".join(indices)


def _triangles(corners: list[str], places: list[list[str]]) -> Iterator[tuple[str, ...]]:
    """Cut a face; one whose corners are not known is left to the parser."""
    if len(corners) <= 4:
        yield tuple(corners)
        return
    indices = [int(corner.split("/", 1)[0]) - 1 for corner in corners]
    if not all(0 <= index < len(places) for index in indices):
        yield tuple(corners)
        return
    for triangle in cut_polygon(np.array([places[index] for index in indices], np.float64)):
        yield tuple(corners[place] for place in triangle)


def cut_polygon(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Cut a polygon into triangles that lie within it.

    Args:
        points: (K, 3) its corners in order, K >= 3; nearly in one plane.

    Returns:
        (T, 3) indices of corners, wound as the polygon is; a fan where the polygon is none.
    """
    fan = np.array([(0, index, index + 1) for index in range(1, len(points) - 1)])
    normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    if not np.isfinite(points).all() or not normal.any():
        return fan
    flat = np.delete(points - points[0], np.abs(normal).argmax(), axis=1)
    cut = (
        mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], np.uint32))
        .astype(np.int64)
        .reshape(-1, 3)
    )
    if len(cut) == 0:
        return fan
    is_turned = np.sign(_areas(flat[cut])) != np.sign(_areas(flat[fan]).sum())
    cut[is_turned] = cut[is_turned, ::-1]
    return cut


def _areas(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T,) signed areas of (T, 3, 2) triangles, doubled."""
    (x1, z1), (x2, z2) = (triangles[:, 1] - triangles[:, 0]).T, (triangles[:, 2] - triangles[:, 0]).T
    return np.asarray(x1 * z2 - z1 * x2)
