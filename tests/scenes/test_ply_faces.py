"""Binary PLY: polygons become fans of triangles in their colours; what is read rightly is left alone."""

import struct
from pathlib import Path
from typing import Final

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from PIL import Image

from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes import load_scene
from anm_gym.scenes.ply_faces import plain_ply
from anm_gym.scenes.reading import RawMesh, read_triangles

Faces = list[list[int]]
Colors = list[tuple[int, int, int]]

ORDERS: Final = {"<": "binary_little_endian", ">": "binary_big_endian"}
LENGTHS: Final = {"char": "B", "uchar": "B", "uint8": "B", "int": "I"}
CODES: Final = {"short": "h", "int": "i", "uint32": "I", "float": "f", "double": "d"}
RGB: Final = "property uchar red\nproperty uchar green\nproperty uchar blue\n"

# A pentagon between two triangles and a quad, all in the plane z = 0.
POINTS: Final = np.array(
    [[0, 0, 0], [4, 0, 0], [4, 3, 0], [2, 4, 0], [0, 3, 0], [6, 0, 0], [6, 3, 0], [-1, 0, 0], [-1, 3, 0]],
    float,
)
MIXED: Final[Faces] = [[7, 0, 8], [0, 4, 8], [0, 1, 2, 3, 4], [1, 5, 6, 2]]
COLORS: Final[Colors] = [(10, 20, 30), (40, 50, 60), (70, 80, 90), (200, 210, 220)]
AREA_M2: Final = 1.5 + 1.5 + 14.0 + 6.0
FANS: Final[Faces] = [[7, 0, 8], [0, 4, 8], [0, 1, 2], [0, 2, 3], [0, 3, 4], [1, 5, 6], [1, 6, 2]]
POLYGON_OF_FAN: Final = [0, 1, 2, 2, 2, 3, 3]

ROOM_POINTS: Final = np.array(
    [[x, y, z] for z in (0, 2.5) for x, y in ((0, 0), (6, 0), (6, 4), (0, 4))], float
)
ROOM: Final[Faces] = [
    [0, 1, 2, 3],
    [7, 6, 5, 4],
    *([k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k] for k in range(4)),
]


def ply(
    faces: Faces,
    colors: Colors | None = None,
    *,
    points: NDArray[np.float64] = POINTS,
    order: str = "<",
    kinds: tuple[str, str, str] = ("double", "uchar", "int"),
    name: str = "vertex_indices",
) -> bytes:
    """Write a binary PLY by hand: `kinds` are the types of coordinates, of lengths and of indices."""
    kind, count, index = kinds
    head = f"ply\nformat {ORDERS[order]} 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property {kind} {axis}\n" for axis in "xyz") + f"element face {len(faces)}\n"
    head += f"property list {count} {index} {name}\n" + (RGB if colors else "") + "end_header\n"
    body = points.astype(order + CODES[kind]).tobytes()
    for place, face in enumerate(faces):
        body += struct.pack(f"{order}{LENGTHS[count]}{len(face)}{CODES[index]}", len(face), *face)
        body += bytes(colors[place]) if colors else b""
    return head.encode() + body


def read(folder: Path, content: bytes) -> RawMesh:
    (folder / "mesh.ply").write_bytes(content)
    return read_triangles(folder / "mesh.ply")


def area_m2(mesh: RawMesh) -> float:
    return float(TriangleMesh(mesh.vertices, mesh.faces.astype(np.int32)).areas_m2.sum())


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("faces", [MIXED, MIXED[::-1]], ids=["triangle first", "quad first"])
def test_mixed_polygons_become_fans(tmp_path: Path, order: str, faces: Faces) -> None:
    mesh = read(tmp_path, ply(faces, order=order))
    assert sorted(mesh.faces.tolist()) == sorted(FANS)
    assert area_m2(mesh) == pytest.approx(AREA_M2)
    assert mesh.face_colors is None
    np.testing.assert_array_equal(mesh.vertices, POINTS)


@pytest.mark.parametrize("order", ORDERS)
def test_triangles_have_the_colour_of_their_polygon(tmp_path: Path, order: str) -> None:
    mesh = read(tmp_path, ply(MIXED, COLORS, order=order))
    assert mesh.faces.tolist() == FANS
    assert mesh.face_colors is not None
    assert mesh.face_colors.tolist() == [list(COLORS[polygon]) for polygon in POLYGON_OF_FAN]


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize(
    "kinds", [("float", "uint8", "short"), ("double", "int", "uint32"), ("double", "char", "int")]
)
@pytest.mark.parametrize("name", ["vertex_index", "vertex_indices"])
def test_any_types_of_lengths_and_indices_are_read(
    tmp_path: Path, order: str, kinds: tuple[str, str, str], name: str
) -> None:
    content = ply(MIXED, COLORS, order=order, kinds=kinds, name=name)
    assert read(tmp_path, content).faces.tolist() == FANS


def test_convex_polygon_of_many_corners_keeps_its_area(tmp_path: Path) -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    points = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    mesh = read(tmp_path, ply([[0, 1, 2], [*range(200)]], points=points, kinds=("double", "char", "int")))
    triangle_m2 = area_m2(read(tmp_path, ply([[0, 1, 2]], points=points)))
    assert len(mesh.faces) == 1 + 198
    assert area_m2(mesh) - triangle_m2 == pytest.approx(100.0 * np.sin(2.0 * np.pi / 200))


def test_faces_of_fewer_than_three_corners_are_dropped(tmp_path: Path) -> None:
    mesh = read(tmp_path, ply([[], [0], [0, 1], *MIXED]))
    assert mesh.faces.tolist() == FANS
    with pytest.raises(SceneError, match="must hold triangles, got PointCloud"):
        read(tmp_path, ply([[0, 1], [1, 2]]))


def test_other_lists_of_a_face_are_dropped_and_other_elements_kept(tmp_path: Path) -> None:
    head, body = ply([]).split(b"element face 0\nproperty list uchar int vertex_indices\nend_header\n")
    head += b"element face 4\nproperty short flags\nproperty list uchar float texcoord\n"
    head += b"property list uchar int vertex_indices\nproperty float red\nelement mark 1\nproperty int at\n"
    for place, face in enumerate(MIXED):
        uv = [0.5] * 2 * len(face)
        body += struct.pack(f"<hB{len(uv)}f", place, len(uv), *uv)
        body += struct.pack(f"<B{len(face)}if", len(face), *face, 0.25 * place)
    content = head + b"end_header\n" + body + struct.pack("<i", 77)
    plain = plain_ply(content)
    assert plain is not None
    assert plain.endswith(struct.pack("<i", 77))
    assert b"texcoord" not in plain
    raw = trimesh.load_scene(trimesh.util.wrap_as_stream(plain), file_type="ply", process=False)
    elements = next(iter(raw.geometry.values())).metadata["_ply_raw"]
    assert elements["face"]["data"]["flags"].tolist() == POLYGON_OF_FAN
    assert elements["face"]["data"]["red"].tolist() == [0.25 * polygon for polygon in POLYGON_OF_FAN]
    assert read(tmp_path, content).faces.tolist() == FANS


def test_names_in_latin_1_do_not_make_polygons_unreadable(tmp_path: Path) -> None:
    comment = "comment Küche\nelement vertex".encode("latin-1")
    content = ply(MIXED, COLORS).replace(b"element vertex", comment)
    assert read(tmp_path, content).faces.tolist() == FANS


PLAIN: Final = {
    "triangles": ply(FANS),
    "triangles with colours": ply(FANS, COLORS + COLORS[:3]),
    "quads": ply(MIXED[3:]),
    "pentagons": ply(MIXED[2:3]),
    "no faces": ply([]),
    "text": ply(MIXED).replace(b"binary_little_endian", b"ascii"),
    "unknown type": ply(MIXED, kinds=("double", "uchar", "int")).replace(b"list uchar", b"list octet"),
    "lengths that are no integers": ply(MIXED).replace(b"list uchar", b"list float"),
    "no list of corners": ply(MIXED, COLORS).replace(b"vertex_indices", b"neighbours"),
    "points with lists": ply(MIXED).replace(b"property double x", b"property list uchar int x"),
    "no end of the header": ply(MIXED).replace(b"end_header", b"end"),
}


@pytest.mark.parametrize("case", PLAIN)
def test_what_is_read_already_or_not_understood_is_left_alone(case: str) -> None:
    assert plain_ply(PLAIN[case]) is None


@pytest.mark.parametrize("colors", [None, COLORS])
def test_truncated_polygons_are_refused(tmp_path: Path, colors: Colors | None) -> None:
    content = ply(MIXED, colors)
    for kept in range(content.index(b"end_header\n") + 11, len(content)):
        with pytest.raises(SceneError, match=r"cannot be read as .ply .*it may be truncated"):
            read(tmp_path, content[:kept])


def test_more_faces_than_there_are_data_are_refused() -> None:
    with pytest.raises(ValueError, match="the data end before the last of 999999999999 faces"):
        plain_ply(ply(MIXED).replace(b"face 4", b"face 999999999999"))


def test_room_of_quads_keeps_its_colours(tmp_path: Path) -> None:
    colors = [(40 * place, 7, 9) for place in range(6)]
    (tmp_path / "room.ply").write_bytes(ply(ROOM, colors, points=ROOM_POINTS))
    mesh = load_scene(tmp_path / "room.ply", up_axis="z").mesh
    assert mesh.face_colors is not None
    assert mesh.face_colors.tolist() == [[*color] for color in colors for _ in range(2)]
    assert (np.abs(mesh.normals[:4, 1]) > 0.9).all()  # floor and ceiling come first


def test_text_quads_with_colours_are_read_without_them(tmp_path: Path) -> None:
    head = ply(ROOM, [(1, 2, 3)] * 6, points=ROOM_POINTS).split(b"end_header\n")[0]
    lines = [" ".join(map(str, point)) for point in ROOM_POINTS.tolist()]
    lines += [" ".join(map(str, [4, *face, 1, 2, 3])) for face in ROOM]
    text = (
        head.replace(b"binary_little_endian", b"ascii") + b"end_header\n" + "\n".join(lines).encode() + b"\n"
    )
    (tmp_path / "room.ply").write_bytes(text)
    mesh = load_scene(tmp_path / "room.ply", up_axis="z").mesh
    assert len(mesh.faces) == 12
    assert mesh.face_colors is None


def test_truncated_texture_is_refused(tmp_path: Path, rng: np.random.Generator) -> None:
    Image.fromarray(rng.integers(0, 255, (64, 64, 3), np.uint8)).save(tmp_path / "whole.png")
    whole = (tmp_path / "whole.png").read_bytes()
    (tmp_path / "room.mtl").write_text("newmtl paper\nmap_Kd half.png\n", encoding="utf-8")
    lines = [
        "mtllib room.mtl",
        *("v {} {} {}".format(*point) for point in ROOM_POINTS.tolist()),
        "vt 0.2 0.4",
    ]
    lines += ["usemtl paper", *("f " + " ".join(f"{corner + 1}/1" for corner in face) for face in ROOM)]
    (tmp_path / "room.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (tmp_path / "half.png").write_bytes(whole)
    assert load_scene(tmp_path / "room.obj", up_axis="z").mesh.face_colors is not None
    (tmp_path / "half.png").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(SceneError, match=r"room.obj cannot be read as .obj \(OSError: .*it may be truncated"):
        load_scene(tmp_path / "room.obj", up_axis="z")
