"""The mesh report: counts and shares that can be worked out by hand, warnings, table, picture, command."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from anm_gym.mesh import TriangleMesh
from anm_gym.scenes import Scene, Storey, load_scene, mesh_report
from anm_gym.scenes.__main__ import main
from anm_gym.scenes.advice import MANY_TRIANGLES, suspected_unit
from anm_gym.scenes.picture import draw_storey
from anm_gym.scenes.report import count_duplicate_faces
from anm_gym.scenes.storeys import find_storeys
from anm_gym.scenes.table import report_table
from anm_gym.scenes.topdown import REACHABLE

BoxRoom = Callable[..., TriangleMesh]


def scene_of(mesh: TriangleMesh) -> Scene:
    storeys = find_storeys(mesh)
    return Scene("room", mesh, storeys[0].floor_y_m, storeys[0].ceiling_y_m, storeys, "test")


def without(mesh: TriangleMesh, dropped: np.ndarray) -> TriangleMesh:
    return TriangleMesh(mesh.vertices, mesh.faces[~dropped])


@pytest.fixture
def room_file(tmp_path: Path, box_room: BoxRoom) -> Path:
    room = box_room(6.0, 4.0)
    path = tmp_path / "room.glb"
    trimesh.Trimesh(room.vertices, room.faces, process=False).export(path)
    return path


def test_closed_room_is_fit(box_room: BoxRoom) -> None:
    report = mesh_report(scene_of(box_room(6.0, 4.0)))
    assert report.size_m == (6.0, 2.5, 4.0)
    assert report.num_triangles == 12
    assert report.surface_m2 == pytest.approx(2 * (6 * 4 + 6 * 2.5 + 4 * 2.5))
    assert report.warnings == ()
    (storey,) = report.storeys
    assert storey.surroundings.escape_share == 0.0
    assert storey.surroundings.back_face_share == 0.0
    assert storey.height_m == pytest.approx(2.5)


def test_roofless_room_loses_the_rays_that_pass_over_its_walls(box_room: BoxRoom) -> None:
    room = box_room(6.0, 4.0)
    is_ceiling = (room.triangles[:, :, 1] > 2.0).all(axis=1)
    report = mesh_report(scene_of(without(room, is_ceiling)))
    rays = report.storeys[0].surroundings
    assert rays.level_escape_share == 0.0
    assert 0.1 < rays.escape_share < 0.4
    assert any("has no ceiling" in warning for warning in report.warnings)


def test_missing_wall_loses_level_rays(box_room: BoxRoom) -> None:
    room = box_room(4.0, 4.0)
    is_wall = (room.triangles[:, :, 0] > 1.9).all(axis=1)
    report = mesh_report(scene_of(without(room, is_wall)))
    assert 0.2 < report.storeys[0].surroundings.level_escape_share < 0.3
    assert any("of the level rays" in warning for warning in report.warnings)


def test_room_wound_inside_out_shows_only_back_faces(box_room: BoxRoom) -> None:
    room = box_room()
    report = mesh_report(scene_of(TriangleMesh(room.vertices, room.faces[:, ::-1].copy())))
    assert report.storeys[0].surroundings.back_face_share == 1.0
    assert any("shows back faces to 100% of the rays" in warning for warning in report.warnings)


def test_repeated_faces_are_counted_whatever_their_winding(box_room: BoxRoom) -> None:
    room = box_room()
    faces = np.concatenate([room.faces, room.faces[:3, ::-1], room.faces[:2]])
    doubled = TriangleMesh(room.vertices, faces)
    assert count_duplicate_faces(room) == 0
    assert count_duplicate_faces(doubled) == 5
    assert any("are there twice" in warning for warning in mesh_report(scene_of(doubled)).warnings)


def test_parts_that_do_not_join_are_warned_of(box_room: BoxRoom) -> None:
    room = box_room(5.0, 4.0)
    vertices = np.concatenate([room.vertices, room.vertices + np.array([7.0, 0.0, 0.0])])
    pair = TriangleMesh(vertices, np.concatenate([room.faces, room.faces + len(room.vertices)]))
    report = mesh_report(scene_of(pair))
    assert len(report.storeys[0].parts_m2) == 2
    assert any("cannot be reached from the largest" in warning for warning in report.warnings)


def test_wrong_axis_that_was_asked_for_is_warned_of(box_room: BoxRoom) -> None:
    report = mesh_report(scene_of(box_room(6.0, 2.0, 5.0)))
    assert any("largest flat surface lies across z" in warning for warning in report.warnings)


@pytest.mark.parametrize(
    ("height_m", "unit"), [(2.5, None), (4.5, None), (8.2, "ft"), (98.0, "in"), (0.5, None)]
)
def test_storey_of_an_odd_height_is_told_by_its_unit(height_m: float, unit: str | None) -> None:
    assert suspected_unit(height_m) == unit


def test_floor_that_is_not_level_is_warned_of(box_room: BoxRoom) -> None:
    room = box_room(8.0, 8.0)
    turn = trimesh.transformations.rotation_matrix(np.deg2rad(0.8), [0.6, 0.0, 0.8])[:3, :3]
    report = mesh_report(scene_of(TriangleMesh(room.vertices @ turn.T, room.faces)))
    assert report.storeys[0].tilt_deg == pytest.approx(0.8)
    assert any(text.startswith("storey 0 tilts by 0.8 degrees: floor that lies") for text in report.warnings)


def test_feet_taken_for_metres_are_warned_of(box_room: BoxRoom) -> None:
    report = mesh_report(scene_of(box_room(30.0, 20.0, 8.2)))
    assert any("the file may be in 'ft'" in warning for warning in report.warnings)


@pytest.mark.slow
def test_two_million_triangles_load_and_are_warned_of(tmp_path: Path) -> None:
    side = 1000
    index = np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    corners = [index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]]
    first, second, third, fourth = (corner.ravel() for corner in corners)
    faces = np.concatenate([np.stack([first, third, second], 1), np.stack([first, fourth, third], 1)])
    x, z = np.meshgrid(np.linspace(0.0, 8.0, side + 1), np.linspace(0.0, 6.0, side + 1))
    floor = trimesh.Trimesh(np.stack([x.ravel(), 0.0 * x.ravel(), z.ravel()], 1), faces, process=False)
    floor.export(tmp_path / "scan.glb")
    report = mesh_report(tmp_path / "scan.glb")
    assert report.num_triangles == 2 * side * side > MANY_TRIANGLES
    assert any("triangles: loading and metrics take long" in warning for warning in report.warnings)


def test_table_names_storeys_repairs_and_warnings(room_file: Path) -> None:
    room = mesh_report(room_file)
    text = report_table(room)
    assert text.splitlines()[0] == "room"
    assert "6.00 x 2.50 x 4.00 m" in text
    assert "0 *" in text
    assert "warnings" not in text


def test_picture_is_as_green_as_the_room_is_navigable(box_room: BoxRoom) -> None:
    scene = scene_of(box_room(6.0, 4.0))
    picture = draw_storey(scene)
    assert picture.dtype == np.uint8
    assert picture.shape[2] == 3
    green_px = (np.abs(picture.astype(int) - REACHABLE).max(axis=2) < 4).sum()
    px_per_m = 1100 / 6.5
    assert green_px / px_per_m**2 == pytest.approx(scene.storey.navigable_area_m2, rel=0.1)


def test_picture_of_a_storey_without_ceiling_is_drawn(box_room: BoxRoom) -> None:
    room = box_room(3.0, 3.0)
    storeys = (Storey(0, 0.0, None, 7.0), Storey(1, 5.0, None, 7.0))
    assert draw_storey(Scene("two", room, 0.0, None, storeys, "test")).size > 0


def test_command_prints_the_table_and_writes_json_and_picture(
    room_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written, picture = tmp_path / "report.json", tmp_path / "room.png"
    assert main([str(room_file), "--json", str(written), "--picture", str(picture)]) == 0
    assert capsys.readouterr().out.startswith("room\n")
    assert json.loads(written.read_text(encoding="utf-8"))["num_triangles"] == 12
    with Image.open(picture) as image:
        assert image.format == "PNG"


def test_command_tells_what_is_wrong_and_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "none.glb")]) == 1
    assert "error: scene file" in capsys.readouterr().err


def test_command_refuses_options_that_would_do_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["home:studio:0", "--unit", "m", "--storey", "0"]) == 1
    assert "home:studio:0 must come without --unit, --storey; only meshes take any" in capsys.readouterr().err


def test_scene_is_examined_where_there_is_no_embree(room_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = load_scene(room_file).storeys
    monkeypatch.setattr("anm_gym.sim.backends.find_spec", lambda _: None)
    monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)
    assert load_scene(room_file).storeys == expected


def test_rooms_a_step_higher_are_pointed_out(box_room: BoxRoom) -> None:
    """A bed is none."""
    room = box_room(8.0, 6.0)
    is_floor = room.triangles[:, :, 1].max(axis=1) < 0.01
    for width_m, is_room in ((4.0, True), (0.6, False)):
        corners = [
            [x, y, z]
            for x0, x1, y in ((-4.0, 4.0 - width_m, 0.0), (4.0 - width_m, 4.0, 0.3))
            for x, z in ((x0, -3.0), (x1, -3.0), (x1, 3.0), (x0, 3.0))
        ]
        faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [1, 4, 7], [1, 7, 2]])
        mesh = TriangleMesh(
            np.concatenate([room.vertices, corners]),
            np.concatenate([room.faces[~is_floor], faces + len(room.vertices)]).astype(np.int32),
        )
        report = mesh_report(scene_of(mesh))
        assert any("does not reach" in text for text in report.warnings) == is_room
