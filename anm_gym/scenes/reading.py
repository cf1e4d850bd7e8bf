"""From a mesh file to one flat list of coloured triangles, in the file's own axes and unit.

What the numbers mean (unit, up axis) and whether they are sound is left to `cleaning` and `axes`.
"""

import io
import itertools
import json
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import numpy as np
import trimesh
from numpy.typing import NDArray

from anm_gym.errors import SceneError
from anm_gym.scenes.colors import PLAIN_RGB, face_colors_of
from anm_gym.scenes.obj_text import needs_care, plain_obj
from anm_gym.scenes.ply_faces import plain_ply

SUFFIXES: Final = (".glb", ".gltf", ".obj", ".ply", ".stl")
"""The mesh formats that can be read."""

_COMPRESSIONS: Final = {"KHR_draco_mesh_compression": "DracoPy", "EXT_meshopt_compression": "meshoptimizer"}
"""glTF extensions that compress geometry, and the packages with which trimesh undoes them."""
_FIRST_BYTES: Final = {".glb": b"glTF", ".ply": b"ply"}


@dataclass(frozen=True, eq=False)
class RawMesh:
    """Triangles as the file has them: nothing repaired, axes and unit unknown."""

    vertices: NDArray[np.float64]
    """(V, 3) float64, the file's unit and axes; may hold NaN."""
    faces: NDArray[np.int64]
    """(F, 3) int64 indices; may be out of range."""
    face_colors: NDArray[np.uint8] | None
    """(F, 3) uint8 RGB, or None if no part of the file has a colour."""


def read_triangles(path: str | Path) -> RawMesh:
    """Read a mesh file, apply the transforms of its nodes and join its parts.

    Args:
        path: A file with one of `SUFFIXES`.

    Returns:
        Every triangle of the file, in the order of its nodes.

    Raises:
        SceneError: If the file is missing, empty, unknown, broken or holds no triangle.
    """
    file = _checked_file(Path(path))
    parts = _read_parts(file)
    sizes = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    return RawMesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + offset for part, offset in zip(parts, sizes, strict=True)]),
        _joined_colors(parts),
    )


def _checked_file(path: Path) -> Path:
    suffix = path.suffix.lower()
    if suffix == ".json":
        raise SceneError(f"{path} looks like a floor plan; load it with `load_floorplan` or `make_scene`")
    if not path.exists():
        raise SceneError(f"scene file {path} must exist, got nothing there; check the path")
    if path.is_dir():
        raise SceneError(f"`path` must be a file, got the folder {path}; name the mesh inside it")
    if suffix not in SUFFIXES:
        raise SceneError(f"`path` must end in one of {', '.join(SUFFIXES)}, got {path.name!r}; convert it")
    if path.stat().st_size == 0:
        raise SceneError(f"{path} must hold a mesh, got an empty file; copy or export it again")
    _check_first_bytes(path, suffix)
    _check_compression(path, suffix)
    if suffix == ".ply":
        _check_lines(path)
    return path


def _check_first_bytes(path: Path, suffix: str) -> None:
    """Refuse a file whose content is of another format than its suffix says."""
    with path.open("rb") as file:
        start = file.read(16)
    for other, magic in _FIRST_BYTES.items():
        if start.startswith(magic) and suffix != other:
            raise SceneError(f"{path.name} must hold {suffix} data, got {other} data; rename it to {other}")
    if suffix in _FIRST_BYTES and not start.startswith(_FIRST_BYTES[suffix]):
        raise SceneError(
            f"{path.name} must begin with {_FIRST_BYTES[suffix]!r}, got {start!r}; it is not a {suffix} file"
        )


def _check_compression(path: Path, suffix: str) -> None:
    """Refuse glTF whose geometry is compressed in a way that nothing here can undo."""
    if suffix not in {".glb", ".gltf"}:
        return
    with path.open("rb") as file:
        # Behind 12 bytes of a .glb stand the length and the kind of its first part, which is the JSON.
        head = file.read(20) if suffix == ".glb" else b""
        text = file.read(int.from_bytes(head[12:16], "little") if head else -1)
    try:
        required = set(json.loads(text).get("extensionsRequired", ()))
    except (ValueError, AttributeError):
        return  # the parser will say what is wrong
    unknown = sorted(name for name in required & set(_COMPRESSIONS) if not find_spec(_COMPRESSIONS[name]))
    if unknown:
        raise SceneError(
            f"{path.name} must hold plain geometry, got geometry compressed by {' and '.join(unknown)}; "
            "export it without compression, for instance by `gltf-transform copy`"
        )


def _check_lines(path: Path) -> None:
    """Refuse PLY text with fewer lines than its header promises: the parser takes what is there."""
    with path.open("rb") as file:
        head = [
            line.split() for line in itertools.takewhile(lambda line: line.strip() != b"end_header", file)
        ]
        if [b"format", b"ascii"] not in [words[:2] for words in head]:
            return
        counts = [words[2] for words in head if words[:1] == [b"element"] and len(words) == 3]
        promised = sum(int(count) for count in counts if count.isdigit())
        lines = sum(not line.isspace() for line in file)
    if lines < promised:
        raise SceneError(
            f"{path} must hold the {promised} lines of data that its header promises, got {lines}; "
            "it may be truncated: copy or export it again"
        )


def _read_parts(path: Path) -> list[RawMesh]:
    try:
        return list(_parts_of(_parse(path), path))
    except SceneError:
        raise
    except Exception as error:  # parsers and textures raise whatever they meet: KeyError, OSError, ...
        reason = f"{type(error).__name__}: {error}"
        raise SceneError(
            f"{path} cannot be read as {path.suffix} ({reason}); it may be truncated: copy or export it again"
        ) from error


def _parse(path: Path) -> trimesh.Scene:
    text = _rewritten(path)
    if text is None:
        return trimesh.load_scene(path, process=False)
    kind, resolver = path.suffix[1:].lower(), trimesh.resolvers.FilePathResolver(str(path))
    return trimesh.load_scene(io.BytesIO(text), file_type=kind, resolver=resolver, process=False)


def _rewritten(path: Path) -> bytes | None:
    """A file's content where it cannot be parsed as it is: text in another code, faces of many corners."""
    suffix = path.suffix.lower()
    if suffix in {".glb", ".gltf"} or (suffix == ".stl" and not _is_text(path)):
        return None
    if suffix == ".ply":
        with path.open("rb") as file:
            lines = list(itertools.takewhile(lambda line: line.strip() != b"end_header", file))
        head = b"".join(lines)
        text, is_latin = _decoded(head)
        data = path.read_bytes()
        if is_latin:
            data = text.encode() + data[len(head) :]
        return plain_ply(data) or (data if is_latin else None)
    data = path.read_bytes()
    text, is_latin = _decoded(data)
    if suffix == ".obj" and needs_care(data):
        return plain_obj(text).encode()
    return text.encode() if is_latin else None


def _is_text(path: Path) -> bool:
    """Whether an STL file is text: binary ones begin with 80 bytes and the number of triangles."""
    with path.open("rb") as file:
        head = file.read(84)
    return path.stat().st_size != 84 + 50 * int.from_bytes(head[80:84], "little")


def _decoded(data: bytes) -> tuple[str, bool]:
    """Decode text, and tell whether it is Latin-1, which any bytes may be, rather than UTF-8."""
    try:
        return data.decode(), False
    except UnicodeDecodeError:
        return data.decode("latin-1"), True


def _parts_of(scene: trimesh.Scene, path: Path) -> Iterator[RawMesh]:
    is_empty = True
    for node in scene.graph.nodes_geometry:
        world_from_part, name = scene.graph[node]
        geometry = scene.geometry[name]
        if isinstance(geometry, trimesh.Trimesh) and len(geometry.faces) > 0:
            is_empty = False
            yield _flattened(geometry, np.asarray(world_from_part, np.float64))
    if is_empty:
        kinds = sorted({type(geometry).__name__ for geometry in scene.geometry.values()}) or ["nothing"]
        raise SceneError(
            f"{path} must hold triangles, got {' and '.join(kinds)}; "
            "reconstruct a surface first if it is a point cloud"
        )


def _flattened(part: trimesh.Trimesh, world_from_part: NDArray[np.float64]) -> RawMesh:
    """Move a part into the file's world; a mirroring transform turns its winding back."""
    with np.errstate(invalid="ignore"):  # vertices that are not finite are counted later, by `clean_mesh`
        vertices = np.asarray(part.vertices, np.float64) @ world_from_part[:3, :3].T + world_from_part[:3, 3]
    faces = np.asarray(part.faces, np.int64)
    if np.linalg.det(world_from_part[:3, :3]) < 0.0:
        faces = faces[:, ::-1]
    colors = face_colors_of(part)
    if colors is not None and len(colors) != len(faces):
        colors = None  # one for each polygon, and no telling which triangles are whose
    return RawMesh(vertices, faces, colors)


def _joined_colors(parts: list[RawMesh]) -> NDArray[np.uint8] | None:
    if all(part.face_colors is None for part in parts):
        return None
    plain = np.array(PLAIN_RGB, np.uint8)
    colors = [np.tile(plain, (len(p.faces), 1)) if p.face_colors is None else p.face_colors for p in parts]
    return np.concatenate(colors)
