"""Binary PLY in the form that the parser reads rightly: triangles, each with the colour of its face.

The parser takes every face to have as many corners as the first, so that it refuses triangles among quads,
and does not hand the colour of a polygon on to its triangles.
"""

import io
import struct
from array import array
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_ORDERS: Final = {b"binary_little_endian": "<", b"binary_big_endian": ">"}
_INTEGERS: Final = b"char int8 uchar uint8 short int16 ushort uint16 int int32 uint uint32 int64 uint64"
_REALS: Final = b"float16 float float32 double float64"
_LETTERS: Final = dict(zip((_INTEGERS + b" " + _REALS).split(), "bbBBhhHHiiIIqQeffdd", strict=True))
"""The letters by which `struct` and NumPy know the types of a header."""
_CORNER_LISTS: Final = (b"vertex_index", b"vertex_indices")
_RGB: Final = {b"red", b"green", b"blue"}


@dataclass(frozen=True, eq=False)
class _Property:
    line: int
    """Line of the header that declares it."""
    name: bytes
    items: np.dtype[Any]
    """Type of the value, or of the values of a list."""
    count: struct.Struct | None
    """Type of a list's length; None if it is no list."""


@dataclass(frozen=True, eq=False)
class _Element:
    line: int
    """Line of the header that declares it."""
    name: bytes
    length: int
    properties: list[_Property] = field(default_factory=list)

    @property
    def corners(self) -> _Property | None:
        """The list that names the corners of a face; one that stands alone may have any name."""
        lists = [one for one in self.properties if one.count is not None]
        named = [one for one in lists if one.name in _CORNER_LISTS or len(self.properties) == 1]
        return named[0] if named else None


def plain_ply(data: bytes) -> bytes | None:
    """Rewrite the faces of a binary PLY file as triangles, where the parser would misread them.

    Args:
        data: The file's content.

    Returns:
        The same surface: polygons are cut into fans, and each triangle has the single values of its polygon.
        Lists of a face other than its corners, and faces of fewer than three, are dropped; all else stays.
        None if the parser reads the file rightly as it is, or if the header is not understood here.

    Raises:
        ValueError: If the data end before the last face.
    """
    lines, elements = _header_of(data)
    before, face = _until_faces(elements)
    if face is None or face.corners is None or any(one.count for other in before for one in other.properties):
        return None
    sizes = [other.length * sum(one.items.itemsize for one in other.properties) for other in before]
    start = sum(map(len, lines)) + sum(sizes)
    if _is_plain(data, face, start):
        return None
    starts = _starts(data, face, start, face.length)
    triangles = _triangles(data, face, face.corners, starts[:-1])
    lines[face.line] = b"element face %d\n" % len(triangles)
    for one in face.properties:
        if one.count is not None and one is not face.corners:
            lines[one.line] = b""
    head = b"".join(lines)
    return head + data[start - sum(sizes) : start] + triangles.tobytes() + data[starts[-1] :]


def _header_of(data: bytes) -> tuple[list[bytes], list[_Element]]:
    """The lines of a binary file's header and what they declare, which is nothing if they make no sense."""
    lines, elements, order = list[bytes](), list[_Element](), ""
    for line in io.BytesIO(data):
        lines.append(line)
        match line.split():
            case [b"end_header"]:
                return lines, elements
            case [b"format", name, *_]:
                order = _ORDERS.get(name, "")
            case [b"element", name, length] if order and length.isdigit():
                elements.append(_Element(len(lines) - 1, name, int(length)))
            case [b"property", *words] if elements and (one := _property(words, len(lines) - 1, order)):
                elements[-1].properties.append(one)
            case [b"element" | b"property", *_]:
                break
    return lines, []


def _property(words: list[bytes], line: int, order: str) -> _Property | None:
    """What a line declares; None if its types are unknown. Lengths are read without a sign, as they are."""
    match words:
        case [b"list", count, kind, name] if kind in _LETTERS and _LETTERS.get(count, "f") not in "efd":
            length = struct.Struct(order + _LETTERS[count].upper())
            return _Property(line, name, np.dtype(order + _LETTERS[kind]), length)
        case [kind, name] if kind in _LETTERS:
            return _Property(line, name, np.dtype(order + _LETTERS[kind]), None)
    return None


def _until_faces(elements: list[_Element]) -> tuple[list[_Element], _Element | None]:
    """The elements before the faces, and the faces, if there are any."""
    for place, element in enumerate(elements):
        if element.name == b"face" and element.length > 0:
            return elements[:place], element
    return elements, None


def _is_plain(data: bytes, face: _Element, start: int) -> bool:
    """Whether all faces have lists as long as the first, which the parser expects, and no colours to lose."""
    first, end = _starts(data, face, start, 1)
    size = end - first
    if start + face.length * size > len(data):
        return False
    for one, place, count in zip(face.properties, *_walk(data, face, np.array([first])), strict=True):
        if one.count is None:
            continue
        if one is face.corners and count[0] != 3 and (count[0] < 3 or _has_colors(face)):
            return False
        where = int(place[0]) - one.count.size
        counts = np.ndarray((face.length,), one.count.format, data, where, (size,))
        if (counts != count[0]).any():
            return False
    return True


def _has_colors(face: _Element) -> bool:
    """Whether a face has a colour that counts: a texture outdoes it."""
    names = {one.name for one in face.properties}
    return names >= _RGB and b"texcoord" not in names


def _starts(data: bytes, face: _Element, place: int, num_faces: int) -> NDArray[np.int64]:
    """(num_faces + 1,) where each face begins, and where the last one ends."""
    lists, gap = [], 0
    for one in face.properties:
        if one.count is None:
            gap += one.items.itemsize
        else:
            lists.append((gap, one.count.unpack_from, one.count.size, one.items.itemsize))
            gap = 0
    starts = array("q", [place])
    try:
        for _ in range(num_faces):
            for skipped, count_at, count_size, size in lists:
                place += skipped
                place += count_size + size * count_at(data, place)[0]
            place += gap
            starts.append(place)
    except (struct.error, OverflowError):
        place = len(data) + 1
    if place > len(data):
        raise ValueError(f"the data end before the last of {face.length} faces")
    return np.array(starts, np.int64)


def _walk(
    data: bytes, face: _Element, place: NDArray[np.int64]
) -> tuple[list[NDArray[np.int64]], list[NDArray[np.int64]]]:
    """For each property where its values begin in faces that begin at `place`, and how many there are."""
    places, counts = [], []
    for one in face.properties:
        count = np.ones(len(place), np.int64)
        if one.count is not None:
            count = _values(data, np.dtype(one.count.format), place).astype(np.int64)
            place = place + one.count.size
        places.append(place)
        counts.append(count)
        place = place + count * one.items.itemsize
    return places, counts


def _values(data: bytes, kind: np.dtype[Any], places: NDArray[np.int64]) -> NDArray[Any]:
    """The values at places that need not be multiples of their size."""
    every = np.ndarray((len(data) - kind.itemsize + 1,), kind, data, strides=(1,))
    return np.asarray(every[places])


def _triangles(
    data: bytes, face: _Element, corners: _Property, starts: NDArray[np.int64]
) -> NDArray[np.void]:
    """Cut faces into fans, in the layout of the file."""
    places, counts = _walk(data, face, starts)
    num_of_face = np.maximum(counts[face.properties.index(corners)] - 2, 0)
    face_of = np.repeat(np.arange(len(starts)), num_of_face)
    nth = np.arange(len(face_of)) - np.repeat(np.cumsum(num_of_face) - num_of_face, num_of_face)
    fans = np.stack([np.zeros_like(nth), nth + 1, nth + 2], axis=1)
    kept = [one for one in face.properties if one.count is None or one is corners]
    triangles = np.empty(len(face_of), [_field(one) for one in kept])
    for one, place in zip(face.properties, places, strict=True):
        if one is corners:
            corner_places = place[face_of, None] + fans * one.items.itemsize
            triangles[str(one.line)]["count"] = 3
            triangles[str(one.line)]["items"] = _values(data, one.items, corner_places)
        elif one.count is None:
            triangles[str(one.line)] = _values(data, one.items, place[face_of])
    return triangles


def _field(one: _Property) -> tuple[str, Any]:
    """Name and type of a property in a triangle."""
    if one.count is None:
        return str(one.line), one.items
    return str(one.line), [("count", one.count.format), ("items", one.items, (3,))]
