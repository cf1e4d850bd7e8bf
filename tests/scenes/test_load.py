"""Loading: axes, units, colours, transforms and storeys, on rooms whose answers are known."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from PIL import Image

from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes import Scene, load_scene
from anm_gym.scenes.axes import flat_area_peaks_m2, likely_units
from anm_gym.scenes.storeys import find_storeys
from anm_gym.sim.traversable import BodySpec, TraversableGrid

BoxRoom = Callable[..., TriangleMesh]
RED, GREEN = (200, 30, 40), (20, 160, 60)


def save(path: Path, *meshes: TriangleMesh | trimesh.Trimesh) -> Path:
    """Write meshes as the parts of one file."""
    parts = [
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False) if isinstance(mesh, TriangleMesh) else mesh
        for mesh in meshes
    ]
    content = trimesh.Scene(parts) if path.suffix == ".glb" else trimesh.util.concatenate(parts)
    content.export(path)
    return path


def scaled(mesh: TriangleMesh, factor: float) -> TriangleMesh:
    return TriangleMesh(mesh.vertices * factor, mesh.faces)


def moved(mesh: TriangleMesh, shift: tuple[float, float, float]) -> TriangleMesh:
    return TriangleMesh(mesh.vertices + shift, mesh.faces)


def z_up(mesh: TriangleMesh) -> TriangleMesh:
    """Write a y-up mesh the way a z-up file does: (x, y, z) becomes (x, -z, y)."""
    x, y, z = mesh.vertices.T
    return TriangleMesh(np.stack([x, -z, y], axis=1), mesh.faces)


def joined(*meshes: TriangleMesh) -> TriangleMesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]
    return TriangleMesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces).astype(np.int32))


def plate(width_m: float, depth_m: float, y_m: float) -> TriangleMesh:
    """One level rectangle around the y axis."""
    x, z = width_m / 2, depth_m / 2
    vertices = np.array([[-x, y_m, -z], [-x, y_m, z], [x, y_m, z], [x, y_m, -z]])
    return TriangleMesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32))


@pytest.mark.parametrize("suffix", [".glb", ".obj"])
def test_y_up_formats_are_taken_as_they_are(tmp_path: Path, box_room: BoxRoom, suffix: str) -> None:
    scene = load_scene(save(tmp_path / f"room{suffix}", box_room(6.0, 4.0)))
    assert scene.name == "room"
    assert scene.floor_y_m == pytest.approx(0.0, abs=1e-3)
    assert scene.ceiling_y_m == pytest.approx(2.5, abs=1e-3)
    np.testing.assert_allclose(scene.mesh.bounds, [[-3.0, 0.0, -2.0], [3.0, 2.5, 2.0]], atol=1e-6)
    assert scene.repairs == ()


def test_tall_and_narrow_building_is_turned_upright(tmp_path: Path, box_room: BoxRoom) -> None:
    """Its party walls are larger than any floor."""
    house = joined(*(moved(box_room(4.5, 8.0), (0.0, 2.7 * storey, 0.0)) for storey in range(4)))
    scene = load_scene(save(tmp_path / "house.glb", z_up(house)))
    assert [storey.floor_y_m for storey in scene.storeys] == pytest.approx([0.0, 2.7, 5.4, 8.1], abs=0.01)
    assert any("took z as the up axis" in repair for repair in scene.repairs)
    assert load_scene(save(tmp_path / "upright.glb", house)).repairs == ()


@pytest.mark.parametrize("suffix", [".ply", ".stl"])
def test_z_up_formats_are_turned_without_mirroring(tmp_path: Path, box_room: BoxRoom, suffix: str) -> None:
    room = moved(box_room(6.0, 4.0), (0.0, 0.0, 5.0))
    scene = load_scene(save(tmp_path / f"room{suffix}", z_up(room)))
    np.testing.assert_allclose(scene.mesh.bounds, room.bounds, atol=1e-5)
    np.testing.assert_allclose(np.sort(scene.mesh.normals, axis=0), np.sort(room.normals, axis=0), atol=1e-6)
    assert scene.repairs == ()


def test_navigable_area_of_a_box_is_the_floor_less_the_body(tmp_path: Path, box_room: BoxRoom) -> None:
    scene = load_scene(save(tmp_path / "room.glb", box_room(6.0, 4.0)))
    assert scene.storey.navigable_area_m2 == pytest.approx(5.8 * 3.8, rel=0.05)


def test_axis_that_contradicts_the_format_is_repaired_and_recorded(tmp_path: Path, box_room: BoxRoom) -> None:
    scene = load_scene(save(tmp_path / "gibson.glb", z_up(box_room(8.0, 6.0))))
    assert scene.mesh.bounds[1, 1] - scene.mesh.bounds[0, 1] == pytest.approx(2.5)
    assert any("took z as the up axis although .glb files have y up" in repair for repair in scene.repairs)


def test_small_room_of_the_wrong_axis_is_told_by_its_height(tmp_path: Path, box_room: BoxRoom) -> None:
    scene = load_scene(save(tmp_path / "small.glb", z_up(box_room(5.0, 4.0))))
    assert scene.ceiling_y_m == pytest.approx(2.5, abs=1e-3)
    assert len(scene.repairs) == 1


def without_walls(mesh: TriangleMesh, *facing: tuple[int, float]) -> TriangleMesh:
    """Leave out the walls that lie across an axis at a coordinate."""
    kept = np.ones(len(mesh.faces), bool)
    for axis, at_m in facing:
        kept &= ~(np.abs(mesh.triangles[:, :, axis] - at_m) < 1e-6).all(axis=1)
    return TriangleMesh(mesh.vertices, mesh.faces[kept])


@pytest.mark.parametrize(
    ("size_m", "open_to"),
    [
        ((10.0, 1.2, 2.5), []),
        ((30.0, 4.0, 2.5), [(0, -15.0), (0, 15.0)]),
        ((20.0, 6.0, 2.5), [(0, -10.0), (0, 10.0), (1, 2.5)]),
        ((6.0, 5.0, 2.5), [(0, -3.0), (0, 3.0), (1, 2.5), (2, 2.5)]),
    ],
    ids=["narrow", "open ends", "two walls", "one wall"],
)
def test_scene_of_the_wrong_axis_need_not_be_closed_or_wide(
    tmp_path: Path, box_room: BoxRoom, size_m: tuple[float, float, float], open_to: list[tuple[int, float]]
) -> None:
    scene = load_scene(save(tmp_path / "part.glb", z_up(without_walls(box_room(*size_m), *open_to))))
    assert len(scene.repairs) == 1
    assert scene.floor_y_m == pytest.approx(0.0, abs=1e-3)
    assert scene.storey.navigable_area_m2 == pytest.approx((size_m[0] - 0.2) * (size_m[1] - 0.2), rel=0.1)


def test_corridor_narrower_than_high_keeps_the_axis_of_its_format(tmp_path: Path, box_room: BoxRoom) -> None:
    corridor = box_room(10.0, 2.2, 2.6)
    assert flat_area_peaks_m2(corridor)[2] > flat_area_peaks_m2(corridor)[1]
    scene = load_scene(save(tmp_path / "corridor.glb", corridor))
    assert scene.ceiling_y_m == pytest.approx(2.6, abs=1e-3)
    assert scene.repairs == ()


def test_up_axis_that_is_given_is_obeyed(tmp_path: Path, box_room: BoxRoom) -> None:
    scene = load_scene(save(tmp_path / "room.glb", z_up(box_room(8.0, 6.0))), up_axis="y")
    assert scene.mesh.bounds[1, 1] - scene.mesh.bounds[0, 1] == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("unit", "per_metre"), [("cm", 100), ("mm", 1000), ("in", 1 / 0.0254), ("ft", 1 / 0.3048)]
)
def test_unit_scales_to_metres(tmp_path: Path, box_room: BoxRoom, unit: str, per_metre: float) -> None:
    scene = load_scene(save(tmp_path / "room.glb", scaled(box_room(6.0, 4.0), per_metre)), unit=unit)
    np.testing.assert_allclose(scene.mesh.bounds, [[-3.0, 0.0, -2.0], [3.0, 2.5, 2.0]], atol=1e-4)


@pytest.mark.parametrize(("unit", "per_metre"), [("cm", 100), ("mm", 1000), ("in", 1 / 0.0254)])
def test_likely_units_of_a_house_begin_with_its_own(unit: str, per_metre: float) -> None:
    assert likely_units(np.array([12.0, 2.7, 9.0]) * per_metre)[0] == unit


def test_nodes_are_placed_by_their_transforms(tmp_path: Path, box_room: BoxRoom) -> None:
    room = box_room(6.0, 4.0)
    content = trimesh.Scene()
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    mirror[0, 3] = 10.0
    part = trimesh.Trimesh(room.vertices, room.faces, process=False)
    content.add_geometry(part, transform=mirror)
    content.export(tmp_path / "room.glb")
    mesh = load_scene(tmp_path / "room.glb").mesh
    np.testing.assert_allclose(mesh.bounds[:, 0], [7.0, 13.0])
    inward = mesh.bounds.mean(axis=0) - mesh.triangles.mean(axis=1)
    np.testing.assert_array_less(0.0, (inward * mesh.normals).sum(axis=1))


def test_colours_of_faces_vertices_materials_and_textures_reach_the_faces(
    tmp_path: Path, box_room: BoxRoom
) -> None:
    room = box_room(6.0, 4.0)
    painted = trimesh.Trimesh(room.vertices, room.faces, process=False, vertex_colors=[*RED, 255])
    plain = trimesh.Trimesh(*_cube(-2.0), process=False)
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[*GREEN, 255])
    coated = trimesh.Trimesh(*_cube(0.0), process=False)
    coated.visual = trimesh.visual.TextureVisuals(uv=np.zeros((8, 2)), material=material)
    image = Image.fromarray(np.array([[RED, RED], [GREEN, GREEN]], np.uint8))
    paper = trimesh.visual.material.PBRMaterial(baseColorTexture=image, baseColorFactor=[255, 255, 255, 255])
    papered = trimesh.Trimesh(*_cube(2.0), process=False)
    papered.visual = trimesh.visual.TextureVisuals(uv=np.zeros((8, 2)), material=paper)
    mesh = load_scene(save(tmp_path / "room.glb", painted, plain, coated, papered)).mesh
    assert mesh.face_colors is not None
    assert mesh.face_colors.dtype == np.uint8
    center = mesh.triangles.mean(axis=1)
    is_cube = np.abs(center[:, 1] - 0.5) < 0.2
    for x, color in ((-2.0, (200, 200, 200)), (0.0, GREEN), (2.0, GREEN)):
        faces = mesh.face_colors[is_cube & (np.abs(center[:, 0] - x) < 0.2)]
        np.testing.assert_allclose(faces, np.tile(color, (12, 1)), atol=2)
    np.testing.assert_allclose(mesh.face_colors[~is_cube], np.tile(RED, (12, 1)), atol=2)


def test_file_without_colours_has_none(tmp_path: Path, box_room: BoxRoom) -> None:
    assert load_scene(save(tmp_path / "room.stl", z_up(box_room()))).mesh.face_colors is None


def test_storeys_are_found_counted_from_the_lowest_and_selected(tmp_path: Path, box_room: BoxRoom) -> None:
    house = joined(moved(box_room(6.0, 4.0), (0.0, -2.8, 0.0)), box_room(6.0, 6.0))
    path = save(tmp_path / "house.glb", house)
    largest = load_scene(path)
    assert [storey.floor_y_m for storey in largest.storeys] == pytest.approx([-2.8, 0.0], abs=2e-3)
    assert largest.storey.index == 1
    lower = load_scene(path, storey=0)
    assert lower.floor_y_m == pytest.approx(-2.8, abs=2e-3)
    assert lower.ceiling_y_m == pytest.approx(-0.3, abs=2e-3)


def test_table_tops_and_roofs_are_no_storeys(box_room: BoxRoom) -> None:
    table, roof = plate(2.0, 2.0, 0.7), plate(8.0, 8.0, 3.0)
    storeys = find_storeys(joined(box_room(6.0, 6.0), table, roof))
    assert [storey.floor_y_m for storey in storeys] == [0.0]


def test_agent_stands_on_the_upper_face_of_a_thin_slab(box_room: BoxRoom) -> None:
    storeys = find_storeys(joined(box_room(6.0, 6.0), plate(6.0, 6.0, -0.1)))
    assert [storey.floor_y_m for storey in storeys] == [0.0]


def test_winding_does_not_matter_for_the_floor(box_room: BoxRoom) -> None:
    room = box_room()
    turned = TriangleMesh(room.vertices, room.faces[:, ::-1].copy())
    assert find_storeys(turned) == find_storeys(room)


def test_room_without_ceiling_or_walls_is_allowed(box_room: BoxRoom) -> None:
    room = box_room(6.0, 4.0)
    is_ceiling = (room.triangles[:, :, 1] > 2.0).all(axis=1)
    (roofless,) = find_storeys(TriangleMesh(room.vertices, room.faces[~is_ceiling]))
    assert (roofless.floor_y_m, roofless.ceiling_y_m) == (0.0, None)
    (bare,) = find_storeys(plate(6.0, 4.0, 1.0))
    assert (bare.floor_y_m, bare.ceiling_y_m) == (1.0, None)


def test_attic_too_low_to_stand_in_is_no_storey(box_room: BoxRoom) -> None:
    attic = moved(box_room(6.0, 6.0, 1.2), (0.0, 2.8, 0.0))
    assert len(find_storeys(joined(box_room(6.0, 6.0), attic))) == 1


def test_loading_twice_gives_the_same_scene(tmp_path: Path, box_room: BoxRoom) -> None:
    path = save(tmp_path / "room.glb", box_room())
    first, second = load_scene(path), load_scene(path)
    assert first.mesh.content_hash == second.mesh.content_hash
    assert first.storeys == second.storeys


def test_storey_that_is_not_there_is_refused(tmp_path: Path, box_room: BoxRoom) -> None:
    path = save(tmp_path / "room.glb", box_room())
    with pytest.raises(
        SceneError, match=r"`storey` of room must be in \[0, 0\], got 3; it has 0: y = 0.00 m"
    ):
        load_scene(path, storey=3)


@pytest.mark.slow
def test_real_scenes_have_the_floors_and_areas_measured_for_them(shared_scenes: Path) -> None:
    for entry in json.loads((shared_scenes / "scenes.json").read_text(encoding="utf-8")):
        scene = load_scene(shared_scenes / entry["file"])
        for floor in entry["floors"]:
            area_m2 = _largest_part_m2(scene, floor["y"])
            assert area_m2 == pytest.approx(floor["nav_area_m2"][0], rel=0.1), entry["name"]


def _largest_part_m2(scene: Scene, floor_y_m: float) -> float:
    """Area for a body of 0.18 m radius on the storey that lies within 5 cm of a height."""
    (storey,) = [storey for storey in scene.storeys if abs(storey.floor_y_m - floor_y_m) < 0.05]
    body = BodySpec(radius_m=0.18)
    return TraversableGrid.from_mesh(scene.mesh, storey.floor_y_m, body).component_areas_m2[0]


def _cube(x: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    box = trimesh.creation.box((0.2, 0.2, 0.2))
    return np.asarray(box.vertices) + np.array([x, 0.5, 0.0]), np.asarray(box.faces)


def test_room_anywhere_is_loaded(box_room: BoxRoom, tmp_path: Path, rng: np.random.Generator) -> None:
    """The mean of three equal coordinates may be less than the lowest of them by a rounding error."""
    for index in range(40):
        shift = tuple(rng.uniform(-50.0, 50.0, 3).tolist())
        path = save(tmp_path / f"room{index}.obj", moved(box_room(6.0, 4.0), shift))
        assert load_scene(path).floor_y_m == pytest.approx(shift[1], abs=1e-3)


def test_scene_of_geographic_coordinates_is_refused(box_room: BoxRoom, tmp_path: Path) -> None:
    path = save(tmp_path / "utm.obj", moved(box_room(6.0, 4.0), (4e6, 0.0, 3e5)))
    with pytest.raises(SceneError, match=r"must lie within 20000 m of the origin, .* move it there"):
        load_scene(path)
