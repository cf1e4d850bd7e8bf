"""The scene itself: which storey is played and which triangles belong to it."""

from collections.abc import Callable

import numpy as np
import pytest

from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes import Scene, Storey

BoxRoom = Callable[..., TriangleMesh]


def stacked(mesh: TriangleMesh, lift_m: float) -> TriangleMesh:
    """Put a copy of a mesh above it; the copy is red, the original blue."""
    upper = mesh.vertices + np.array([0.0, lift_m, 0.0])
    colors = np.zeros((2 * len(mesh.faces), 3), np.uint8)
    colors[: len(mesh.faces), 2] = colors[len(mesh.faces) :, 0] = 255
    faces = np.concatenate([mesh.faces, mesh.faces + len(mesh.vertices)])
    return TriangleMesh(np.concatenate([mesh.vertices, upper]), faces, colors)


def two_storeys(mesh: TriangleMesh, floor_y_m: float, ceiling_y_m: float | None = 2.5) -> Scene:
    storeys = (Storey(0, 0.0, 2.5, 14.0), Storey(1, 4.0, None, 14.0))
    return Scene("pair", mesh, floor_y_m, ceiling_y_m, storeys, "test")


def test_single_storey_mesh_is_the_whole_mesh(box_room: BoxRoom) -> None:
    mesh = box_room()
    scene = Scene("room", mesh, 0.0, 2.5, (Storey(0, 0.0, 2.5, 14.0),), "test")
    assert scene.storey_mesh is mesh


def test_storey_mesh_holds_the_faces_of_the_storey(box_room: BoxRoom) -> None:
    room = box_room()
    scene = two_storeys(stacked(room, 4.0), 0.0)
    assert len(scene.storey_mesh.faces) == len(room.faces)
    assert scene.storey_mesh.bounds[1, 1] == 2.5
    assert scene.storey_mesh.face_colors is not None
    assert (scene.storey_mesh.face_colors == (0, 0, 255)).all()


def test_storey_without_ceiling_reaches_up_to_the_next_slab_or_the_sky(box_room: BoxRoom) -> None:
    room = box_room()
    mesh = stacked(room, 4.0)
    upper = two_storeys(mesh, 4.0, ceiling_y_m=None)
    assert len(upper.storey_mesh.faces) == len(room.faces)
    tower = two_storeys(box_room(height_m=9.0), 0.0, ceiling_y_m=None)
    assert tower.storey_mesh.bounds[1, 1] == pytest.approx(3.85)
    assert two_storeys(box_room(height_m=9.0), 4.0, ceiling_y_m=None).storey_top_y_m == 9.0


def test_walls_through_several_storeys_are_cut_in_the_slabs(box_room: BoxRoom) -> None:
    scene = two_storeys(box_room(height_m=9.0), 0.0)
    np.testing.assert_allclose(scene.storey_mesh.bounds[:, 1], [0.0, 2.8])
    assert scene.storey_top_y_m == 2.5
    walls_m2, floor_m2 = 4 * 4.0 * 2.8, 4.0 * 4.0
    assert scene.storey_mesh.areas_m2.sum() == pytest.approx(walls_m2 + floor_m2)


def test_thin_slab_is_shared_between_the_storeys(box_room: BoxRoom) -> None:
    pair = stacked(box_room(), 2.7)
    storeys = (Storey(0, 0.0, 2.5, 14.0), Storey(1, 2.7, 5.2, 14.0))
    lower, upper = (Scene("pair", pair, s.floor_y_m, s.ceiling_y_m, storeys, "test") for s in storeys)
    np.testing.assert_allclose(lower.storey_mesh.bounds[:, 1], [0.0, 2.5])
    np.testing.assert_allclose(upper.storey_mesh.bounds[:, 1], [2.7, 5.2])
    lower_walls_m2, both_levels_m2 = 4 * 4.0 * 2.5, 2 * 4.0 * 4.0
    assert lower.storey_mesh.areas_m2.sum() == pytest.approx(lower_walls_m2 + both_levels_m2)


@pytest.mark.parametrize("sheet_m", [2.6037, 2.4996, 2.7219])
def test_single_sheet_is_ceiling_and_floor_at_once(box_room: BoxRoom, sheet_m: float) -> None:
    room = box_room(height_m=sheet_m)
    pair, rounded_m = stacked(room, sheet_m), round(sheet_m, 3)
    storeys = (Storey(0, 0.0, rounded_m, 14.0), Storey(1, rounded_m, 2 * sheet_m, 14.0))
    for storey in storeys:
        cut = Scene("pair", pair, storey.floor_y_m, storey.ceiling_y_m, storeys, "test").storey_mesh
        level_m = np.unique(cut.triangles[np.abs(cut.normals[:, 1]) > 0.9][:, :, 1])
        assert sheet_m in level_m.round(6)
        assert cut.bounds[1, 1] - cut.bounds[0, 1] < sheet_m + 0.11


def test_floor_beside_a_storey_does_not_cut_it(box_room: BoxRoom) -> None:
    """On split levels the next floor lies under this one's ceiling."""
    storeys = (Storey(0, 0.0, 2.5, 14.0), Storey(1, 2.0, 4.5, 14.0))
    scene = Scene("split", box_room(height_m=9.0), 0.0, 2.5, storeys, "test")
    assert scene.storey_mesh.bounds[1, 1] == pytest.approx(2.8)


def test_single_storey_is_as_high_as_its_mesh(box_room: BoxRoom) -> None:
    tower = box_room(height_m=9.0)
    assert Scene("hall", tower, 0.0, 2.5, (Storey(0, 0.0, 2.5, 14.0),), "test").storey_top_y_m == 9.0


def test_storey_is_the_selected_one(box_room: BoxRoom) -> None:
    assert two_storeys(box_room(), 4.0).storey.index == 1


def test_scene_without_storeys_is_refused(box_room: BoxRoom) -> None:
    with pytest.raises(SceneError, match="must have at least one storey, got none"):
        Scene("none", box_room(), 0.0, 2.5, (), "test")


def test_floor_that_belongs_to_no_storey_is_refused(box_room: BoxRoom) -> None:
    with pytest.raises(SceneError, match=r"must be the floor of a storey \(0.000, 4.000\), got 1.0"):
        two_storeys(box_room(), 1.0)
