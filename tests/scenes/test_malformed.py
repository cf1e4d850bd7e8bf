"""Broken input: every file here ends in a SceneError that names cause and remedy, or in a recorded repair."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes import load_scene, make_scene, mesh_report

BoxRoom = Callable[..., TriangleMesh]

PLY_HEAD = "ply\nformat ascii 1.0\nelement vertex {vertices}\n{properties}{faces}end_header\n"
XYZ = "property float x\nproperty float y\nproperty float z\n"
RGB = "property float red\nproperty float green\nproperty float blue\n"


@pytest.fixture
def room(box_room: BoxRoom) -> TriangleMesh:
    return box_room(6.0, 4.0)


def ply(vertices: NDArray[np.float64], faces: NDArray[np.int32] | None, properties: str = XYZ) -> bytes:
    """Write an ASCII PLY by hand, as exporters refuse to write nonsense."""
    count = "" if faces is None else f"element face {len(faces)}\nproperty list uchar int vertex_indices\n"
    head = PLY_HEAD.format(vertices=len(vertices), properties=properties, faces=count)
    rows = [" ".join(map(str, vertex)) for vertex in vertices.tolist()]
    rows += [] if faces is None else ["3 " + " ".join(map(str, face)) for face in faces.tolist()]
    return (head + "\n".join(rows) + "\n").encode()


def glb(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> bytes:
    return bytes(trimesh.Trimesh(vertices, faces, process=False).export(file_type="glb"))


def test_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"none.glb must exist, got nothing there; check the path"):
        load_scene(tmp_path / "none.glb")


def test_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "folder.glb").mkdir()
    with pytest.raises(SceneError, match=r"must be a file, got the folder .*; name the mesh inside it"):
        load_scene(tmp_path / "folder.glb")


BYTES = {
    "empty.glb": (b"", "must hold a mesh, got an empty file"),
    "text.glb": (
        b"once upon a time\n",
        r"must begin with b'glTF', got b'once upon a time'; it is not a .glb file",
    ),
    "text.ply": (b"once upon a time\n", r"must begin with b'ply'"),
    "text.obj": (b"once upon a time\n", r"must hold triangles, got nothing"),
    "text.stl": (b"once upon a time, and what a time\n" * 9, r"(cannot be read as .stl|must hold triangles)"),
    "prose.gltf": (b"once upon a time\n", r"cannot be read as .gltf .*copy or export it again"),
    "other.gltf": (b'{"asset": {"version": "2.0"}}', r"must hold triangles, got nothing"),
    "scan.glb": (
        b"ply\nformat ascii 1.0\nend_header\n",
        r"must hold .glb data, got .ply data; rename it to .ply",
    ),
    "scan.obj": (b"glTF\x02\0\0\0", r"must hold .obj data, got .glb data; rename it to .glb"),
    "scan.fbx": (b"Kaydara", r"must end in one of .glb, .gltf, .obj, .ply, .stl, got 'scan.fbx'; convert it"),
    "scan": (b"glTF", r"must end in one of .*, got 'scan'"),
    "plan.json": (b"{}", r"looks like a floor plan; load it with `load_floorplan` or `make_scene`"),
    "header.glb": (b"glTF\x02\0\0\0", r"cannot be read as .glb .*it may be truncated"),
    "points.ply": (ply(np.eye(3), None), r"must hold triangles, got PointCloud; reconstruct a surface first"),
    "index.ply": (ply(np.eye(3), np.array([[0, 1, 9]])), r"must name one of its 3 vertices, got index 9"),
    "nan.ply": (ply(np.full((3, 3), np.nan), np.array([[0, 1, 2]])), r"got NaN or infinity in every face"),
    "flat.ply": (
        ply(np.eye(3), np.array([[0, 1, 1]])),
        r"must have a triangle with area, got only degenerate",
    ),
}


@pytest.mark.parametrize("name", BYTES)
def test_unreadable_file_is_refused(tmp_path: Path, name: str) -> None:
    content, message = BYTES[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(SceneError, match=message):
        load_scene(tmp_path / name)


@pytest.mark.parametrize("share", [0.2, 0.6, 0.99])
def test_truncated_file_is_refused(tmp_path: Path, room: TriangleMesh, share: float) -> None:
    content = glb(room.vertices, room.faces)
    (tmp_path / "room.glb").write_bytes(content[: int(share * len(content))])
    with pytest.raises(
        SceneError, match=r"cannot be read as .glb .*it may be truncated: copy or export it again"
    ):
        load_scene(tmp_path / "room.glb")


@pytest.mark.parametrize("corners", [3, 4])
def test_truncated_text_is_refused(tmp_path: Path, room: TriangleMesh, corners: int) -> None:
    content = ply(room.vertices, room.faces)
    if corners == 4:  # two triangles of a side share its diagonal
        sides = [[*first, next(v for v in second if v not in first)] for first, second in _pairs(room.faces)]
        content = ply(room.vertices, np.array(sides)).replace(b"\n3 ", b"\n4 ")
    lines = content.splitlines(keepends=True)
    count = len(lines) - lines.index(b"end_header\n") - 1
    for kept in range(len(lines) - 1, len(lines) - count, -1):
        (tmp_path / "room.ply").write_bytes(b"".join(lines[:kept]))
        got = count - len(lines) + kept
        with pytest.raises(
            SceneError, match=rf"must hold the {count} lines .*got {got}; it may be truncated"
        ):
            load_scene(tmp_path / "room.ply", up_axis="y")
    (tmp_path / "room.ply").write_bytes(content)
    assert len(load_scene(tmp_path / "room.ply", up_axis="y").mesh.faces) == 12


def _pairs(faces: NDArray[np.int32]) -> list[NDArray[np.int32]]:
    return [*faces.reshape(6, 2, 3)]


def _walls_only(room: TriangleMesh) -> TriangleMesh:
    is_wall = np.abs(room.normals[:, 1]) < 0.5
    return TriangleMesh(room.vertices, room.faces[is_wall])


def _one_triangle(room: TriangleMesh) -> TriangleMesh:
    return TriangleMesh(np.array([[0.0, 0, 0], [0, 0, 1], [1.2, 0, 0]]), room.faces[:1] * 0 + [[0, 1, 2]])


def _scaled(room: TriangleMesh, factor: float) -> TriangleMesh:
    return TriangleMesh(room.vertices * factor, room.faces)


def _squashed(room: TriangleMesh) -> TriangleMesh:
    return TriangleMesh(room.vertices * (1.0, 0.4, 1.0), room.faces)


MESHES: dict[str, tuple[Callable[[TriangleMesh], TriangleMesh], str]] = {
    "walls without a floor": (
        _walls_only,
        "must have a floor, got 8 triangles .* no level surface; check `up_axis`",
    ),
    "one small triangle": (
        _one_triangle,
        "must have a floor with room for the agent's body, got level surfaces",
    ),
    "ceiling too low": (_squashed, "must have a floor with room for the agent's body, .* too low overhead"),
    "millimetres": (lambda room: _scaled(room, 1000.0), "got 6000 x 2500 x 4000 m with unit='m'; .* in 'mm'"),
    "centimetres": (lambda room: _scaled(room, 100.0), "got 600 x 250 x 400 m with unit='m'; .* in 'cm'"),
    "a doll's house": (lambda room: _scaled(room, 0.1), "must measure 1 to 300 m, got 0.6 x 0.25 x 0.4 m"),
    "a planet": (lambda room: _scaled(room, 1e7), "no known unit makes this a building"),
}


@pytest.mark.parametrize("up_axis", ["y", "auto"])
@pytest.mark.parametrize("case", MESHES)
def test_mesh_on_which_nobody_can_stand_is_refused(
    tmp_path: Path, room: TriangleMesh, case: str, up_axis: str
) -> None:
    make, message = MESHES[case]
    mesh = make(room)
    (tmp_path / "room.glb").write_bytes(glb(mesh.vertices, mesh.faces))
    with pytest.raises(SceneError, match=message):
        load_scene(tmp_path / "room.glb", up_axis=up_axis)


def test_metres_taken_for_centimetres_are_told(tmp_path: Path, room: TriangleMesh) -> None:
    (tmp_path / "room.glb").write_bytes(glb(room.vertices, room.faces))
    with pytest.raises(SceneError, match="with unit='cm'; the file is likely in 'm': pass unit='m'"):
        load_scene(tmp_path / "room.glb", unit="cm")


@pytest.mark.parametrize("storey", [-1, 1])
def test_storey_out_of_range_is_refused(tmp_path: Path, room: TriangleMesh, storey: int) -> None:
    (tmp_path / "room.glb").write_bytes(glb(room.vertices, room.faces))
    with pytest.raises(SceneError, match=rf"`storey` of room must be in \[0, 0\], got {storey}"):
        load_scene(tmp_path / "room.glb", storey=storey)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"unit": "furlong"}, "`unit` must be one of m, cm, mm, in, ft, got 'furlong'"),
        ({"up_axis": "x"}, "`up_axis` must be one of auto, y, z, got 'x'"),
    ],
)
def test_unknown_option_is_a_wrong_argument(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        load_scene("room.glb", **options)


def test_faces_with_nan_vertices_are_dropped_and_counted(tmp_path: Path, room: TriangleMesh) -> None:
    vertices = np.concatenate([room.vertices, [[np.nan, 0.0, 0.0], [np.inf, 0.0, 0.0]]])
    extra = np.array([[0, 1, len(room.vertices)], [0, 1, len(room.vertices) + 1]])
    (tmp_path / "room.ply").write_bytes(ply(vertices, np.concatenate([room.faces, extra])))
    scene = load_scene(tmp_path / "room.ply", up_axis="y")
    assert len(scene.mesh.faces) == 12
    assert scene.repairs == ("dropped 2 faces with a NaN or infinite vertex",)
    assert mesh_report(tmp_path / "room.ply", up_axis="y").num_nan_vertices == 2


def test_degenerate_faces_are_dropped_and_counted(tmp_path: Path, room: TriangleMesh) -> None:
    middle = 0.5 * (room.vertices[:1] + room.vertices[1:2])
    on_a_line, on_a_point = [[0, 1, len(room.vertices)]], [[0, 0, 1]]
    faces = np.concatenate([room.faces, on_a_line, on_a_point])
    (tmp_path / "room.glb").write_bytes(glb(np.concatenate([room.vertices, middle]), faces))
    report = mesh_report(tmp_path / "room.glb")
    assert report.num_triangles == 12
    assert report.num_degenerate_faces == 2
    assert report.repairs == ("dropped 2 degenerate faces (no area)",)


def test_nan_vertex_that_no_face_uses_does_no_harm(tmp_path: Path, room: TriangleMesh) -> None:
    (tmp_path / "room.ply").write_bytes(ply(np.concatenate([room.vertices, [[np.nan] * 3]]), room.faces))
    assert load_scene(tmp_path / "room.ply", up_axis="y").repairs == ()


def test_nan_colours_become_black(tmp_path: Path, room: TriangleMesh) -> None:
    colors = np.full((len(room.vertices), 3), np.nan)
    content = ply(np.hstack([room.vertices, colors]), room.faces, XYZ + RGB)
    (tmp_path / "room.ply").write_bytes(content)
    mesh = load_scene(tmp_path / "room.ply", up_axis="y").mesh
    assert mesh.face_colors is not None
    assert (mesh.face_colors == 0).all()


def test_room_without_ceiling_is_allowed_and_reported(tmp_path: Path, room: TriangleMesh) -> None:
    is_ceiling = (room.triangles[:, :, 1] > 2.0).all(axis=1)
    (tmp_path / "room.glb").write_bytes(glb(room.vertices, room.faces[~is_ceiling]))
    report = mesh_report(tmp_path / "room.glb")
    assert report.storeys[0].ceiling_y_m is None
    assert any("has no ceiling" in warning for warning in report.warnings)


def _plan() -> dict[str, Any]:
    square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]
    corners = [{"x": x, "y": y, "z": 0.0} for y in (0.0, 2.5) for x in (0.0, 4.0)]
    hole = [{"x": 1.0, "y": 0.0, "z": 0.0}, {"x": 2.0, "y": 2.0, "z": 0.0}]
    return {
        "ceiling_height": 2.5,
        "rooms": [{"id": "room|1", "roomType": "Kitchen", "floorPolygon": square}],
        "walls": [{"id": "wall|1", "polygon": corners}],
        "doors": [
            {"id": "door|1", "room0": "room|1", "room1": "room|2", "wall0": "wall|1", "holePolygon": hole}
        ],
    }


PLANS: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "no rooms key": (lambda plan: plan.pop("rooms"), "must have 'rooms', got only 'ceiling_height', 'walls'"),
    "no rooms": (lambda plan: plan.update(rooms=[]), "must have at least one room, got none"),
    "rooms of numbers": (lambda plan: plan.update(rooms=[1]), "'rooms' of plan .* must be a list of objects"),
    "no outline": (
        lambda plan: plan["rooms"][0].pop("floorPolygon"),
        r"room\|1 of .* must have 'floorPolygon'",
    ),
    "bow tie": (
        lambda plan: plan["rooms"][0].update(floorPolygon=[[0, 0], [4, 4], [4, 0], [0, 4]]),
        "must be a simple polygon, got Self-intersection",
    ),
    "two corners": (
        lambda plan: plan["rooms"][0].update(floorPolygon=[[0, 0], [4, 4]]),
        "must be a simple polygon, got too few corners",
    ),
    "words for corners": (
        lambda plan: plan["rooms"][0].update(floorPolygon=["a"]),
        "must be a list of points",
    ),
    "nan corner": (
        lambda plan: plan["rooms"][0].update(floorPolygon=[[0, 0], [4, float("nan")], [4, 0]]),
        "must be at least two finite points",
    ),
    "wall without a name": (lambda plan: plan["walls"][0].pop("id"), "a wall of .* must have 'id'"),
    "wall without corners": (
        lambda plan: plan["walls"][0].pop("polygon"),
        r"wall\|1 of .* must have 'polygon'",
    ),
    "door in no wall": (
        lambda plan: plan["doors"][0].update(wall0="w"),
        "must name a wall of the plan, got 'w'",
    ),
    "door beyond its wall": (
        lambda plan: plan["doors"][0]["holePolygon"][1].update(x=9.0),
        "must lie in its wall of 4.00 m, got 1.00 to 9.00 m along",
    ),
    "low ceiling": (lambda plan: plan.update(ceiling_height=1.2), r"must be in \[1.8, 20.0\] m, got 1.2"),
    "ceiling in words": (lambda plan: plan.update(ceiling_height="high"), "must be in .* got 'high'"),
    "room too small": (
        lambda plan: plan["rooms"][0].update(floorPolygon=[[0, 0], [0.2, 0], [0.2, 0.2], [0, 0.2]]),
        "must have a room with space for the agent's body, got none",
    ),
}


@pytest.mark.parametrize("case", PLANS)
def test_malformed_plan_is_refused(tmp_path: Path, case: str) -> None:
    spoil, message = PLANS[case]
    plan = _plan()
    spoil(plan)
    (tmp_path / "plan.json").write_text(json.dumps(plan), encoding="utf-8")
    with pytest.raises(SceneError, match=message):
        make_scene(str(tmp_path / "plan.json"))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"not json", "must be JSON, got"),
        (b"[]", "must be a JSON object, got a list"),
        (b"\xff\xfe", "must be JSON"),
    ],
)
def test_file_that_is_no_plan_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "plan.json").write_bytes(content)
    with pytest.raises(SceneError, match=message):
        make_scene(str(tmp_path / "plan.json"))


def test_plan_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="must be a file, got nothing there"):
        make_scene(str(tmp_path / "none.json"))


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize("name", ["KHR_draco_mesh_compression", "EXT_meshopt_compression"])
def test_compressed_geometry_is_named(tmp_path: Path, suffix: str, name: str, monkeypatch) -> None:
    monkeypatch.setattr("anm_gym.scenes.reading.find_spec", lambda _: None)
    text = json.dumps({"asset": {"version": "2.0"}, "extensionsRequired": [name]}).encode()
    text += b" " * (-len(text) % 4)
    head = b"glTF" + (2).to_bytes(4, "little") + (20 + len(text)).to_bytes(4, "little")
    head += len(text).to_bytes(4, "little") + b"JSON"
    path = tmp_path / f"packed{suffix}"
    path.write_bytes(head + text if suffix == ".glb" else text)
    with pytest.raises(SceneError, match=f"got geometry compressed by {name}; export it without compression"):
        load_scene(path)
