"""Floor plans: a handmade house whose rooms, doors and areas can be counted."""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from anm_gym.scenes import Scene
from anm_gym.scenes.floorplan import load_floorplan, read_floorplan
from anm_gym.scenes.interior import WALL_THICKNESS_M
from anm_gym.scenes.probes import make_probe, probe_surroundings
from anm_gym.sim.traversable import BodySpec, TraversableGrid

CEILING_M = 2.6
DOOR = (1.0, 2.0, 2.1)
"""From and to along the wall and height, metres."""
OUTLINES = {
    "room|1": [(0.0, 0.0), (0.0, 4.0), (5.0, 4.0), (5.0, 0.0)],
    "room|2": [(5.0, 0.0), (5.0, 4.0), (8.0, 4.0), (8.0, 0.0)],
    "room|3": [(0.0, 4.0), (0.0, 6.0), (8.0, 6.0), (8.0, 4.0), (5.0, 4.0)],
}
"""A kitchen, open towards a living room at its x end, and a bedroom along both."""


def wall(room: str, start: tuple[float, float], end: tuple[float, float], **more: Any) -> dict[str, Any]:
    corners = [{"x": x, "y": y, "z": z} for y in (0.0, CEILING_M) for x, z in (start, end)]
    return {"id": f"wall|{room}|{start}|{end}", "roomId": room, "polygon": corners, **more}


def house() -> dict[str, Any]:
    """Rooms 1 and 2 are open-plan; a door leads from 1 to 3; an outer door in 2 stays closed."""
    walls = []
    for room, outline in OUTLINES.items():
        for start, end in pairwise([*outline, outline[0]]):
            is_open = {start, end} == {(5.0, 0.0), (5.0, 4.0)}
            walls.append(wall(room, start, end, **({"empty": True} if is_open else {})))
    near, far, top = DOOR
    hole = [{"x": near, "y": 0.0, "z": 0.0}, {"x": far, "y": top, "z": 0.0}]
    inner = {"id": "door|1|3", "room0": "room|1", "room1": "room|3", "wall0": _wall_id("room|1", walls, 4.0)}
    outer = {"id": "door|0|2", "room0": "room|2", "room1": "room|2", "wall0": _wall_id("room|2", walls, 0.0)}
    rooms = [
        {"id": room, "roomType": kind, "floorPolygon": [list(corner) for corner in OUTLINES[room]]}
        for room, kind in zip(OUTLINES, ("Kitchen", "LivingRoom", "Bedroom"), strict=True)
    ]
    doors = [{**door, "holePolygon": hole} for door in (inner, outer)]
    return {"ceiling_height": CEILING_M, "rooms": rooms, "walls": walls, "doors": doors}


def _wall_id(room: str, walls: list[dict[str, Any]], z: float) -> str:
    """Name the wall of a room that runs along x at a z of the file."""
    found = [w["id"] for w in walls if w["roomId"] == room and all(p["z"] == z for p in w["polygon"])]
    return str(found[0])


def save(folder: Path, content: dict[str, Any]) -> Path:
    path = folder / "house.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return load_floorplan(save(tmp_path, house()))


def rooms_reached(scene: Scene, path: Path, radius_m: float = 0.18) -> int:
    """Count the rooms that hold a place of the largest part."""
    grid = TraversableGrid.from_mesh(scene.mesh, 0.0, BodySpec(radius_m=radius_m))
    x, z = grid.frame.centers_of(np.argwhere(grid.component == 1)).T
    rooms = read_floorplan(path).rooms
    return sum(bool(shapely.contains_xy(shapely.Polygon(room.outline_xz), x, z).any()) for room in rooms)


def test_plan_keeps_x_and_turns_z_round(scene: Scene) -> None:
    half = WALL_THICKNESS_M / 2
    np.testing.assert_allclose(scene.mesh.bounds[0], [half, 0.0, -6.0 + half], atol=1e-9)
    np.testing.assert_allclose(scene.mesh.bounds[1], [8.0 - half, CEILING_M, -half], atol=1e-9)


def test_every_room_is_reached_through_its_door(scene: Scene, tmp_path: Path) -> None:
    assert rooms_reached(scene, tmp_path / "house.json") == 3
    assert len(TraversableGrid.from_mesh(scene.mesh, 0.0).component_areas_m2) == 1


def test_without_its_door_a_room_is_cut_off(tmp_path: Path) -> None:
    content = house()
    content["doors"] = content["doors"][1:]
    path = save(tmp_path, content)
    assert rooms_reached(load_floorplan(path), path) == 2


def test_floor_area_is_the_rooms_less_the_walls(scene: Scene) -> None:
    """By hand: inner box 7.9 x 5.9, less the wall along x = 0..8 at z = 4, plus the doorway."""
    near, far, _ = DOOR
    expected_m2 = 7.9 * 5.9 - 7.9 * 0.1 + (far - near) * 0.1
    is_floor = scene.mesh.normals[:, 1] > 0.99
    assert scene.mesh.areas_m2[is_floor].sum() == pytest.approx(expected_m2, abs=1e-3)


def test_mesh_is_closed_and_faces_the_air(scene: Scene) -> None:
    grid = TraversableGrid.from_mesh(scene.mesh, 0.0)
    seen = probe_surroundings(make_probe(scene.mesh), scene.mesh, grid, 0.0)
    assert (seen.escape_share, seen.level_escape_share, seen.back_face_share) == (0.0, 0.0, 0.0)
    assert seen.ceiling_y_m == pytest.approx(CEILING_M, abs=1e-6)


def test_volume_of_the_air_is_that_of_the_plan(scene: Scene) -> None:
    """The divergence theorem over an inward-facing closed surface."""
    near, far, top = DOOR
    expected_m3 = CEILING_M * (7.9 * 5.9 - 7.9 * 0.1) + (far - near) * 0.1 * top
    first, second, third = scene.mesh.triangles.transpose(1, 0, 2)
    volume_m3 = -(first * np.cross(second, third)).sum() / 6.0
    assert volume_m3 == pytest.approx(expected_m3, abs=1e-3)


def test_doorway_has_a_lintel(scene: Scene) -> None:
    near, far, top = DOOR
    looks_down = scene.mesh.normals[:, 1] < -0.99
    is_lintel = looks_down & (np.abs(scene.mesh.triangles[:, :, 1] - top) < 1e-9).all(axis=1)
    assert scene.mesh.areas_m2[is_lintel].sum() == pytest.approx((far - near) * WALL_THICKNESS_M, abs=1e-3)
    doorway = scene.mesh.triangles[is_lintel][:, :, [0, 2]].reshape(-1, 2)
    np.testing.assert_allclose(doorway.mean(axis=0), [1.5, -4.0], atol=0.05)


def test_door_beside_a_crossing_wall_does_not_cut_it(tmp_path: Path) -> None:
    content = house()
    content["doors"][0]["holePolygon"][0]["x"] = 0.0
    mesh = load_floorplan(save(tmp_path, content)).mesh
    assert mesh.bounds[0, 0] == pytest.approx(WALL_THICKNESS_M / 2)


def test_window_is_an_opening_with_a_sill_only_if_it_is_a_door_of_the_plan(tmp_path: Path) -> None:
    content = house()
    content["doors"][0]["holePolygon"][0]["y"] = 0.8
    path = save(tmp_path, content)
    scene = load_floorplan(path)
    assert rooms_reached(scene, path) == 2
    is_sill = (scene.mesh.normals[:, 1] > 0.99) & (scene.mesh.triangles[:, :, 1].mean(axis=1) > 0.5)
    assert scene.mesh.areas_m2[is_sill].sum() == pytest.approx(0.1, abs=1e-3)


def test_ceiling_is_taken_from_the_walls_if_not_given(tmp_path: Path) -> None:
    content = house()
    del content["ceiling_height"]
    assert load_floorplan(save(tmp_path, content)).ceiling_y_m == CEILING_M


def test_rooms_may_be_given_as_points_with_names(tmp_path: Path) -> None:
    content = house()
    for room in content["rooms"]:
        room["floorPolygon"] = [{"x": x, "y": 0.0, "z": z} for x, z in room["floorPolygon"]]
    assert len(load_floorplan(save(tmp_path, content)).mesh.faces) > 0


def test_loading_twice_gives_the_same_mesh(scene: Scene, tmp_path: Path) -> None:
    again = load_floorplan(tmp_path / "house.json")
    assert again.mesh.content_hash == scene.mesh.content_hash


def test_shared_plans_load_with_all_their_rooms_reached(shared_floorplans: Path) -> None:
    for path in sorted(shared_floorplans.glob("*.json"))[:5]:
        plan = read_floorplan(path)
        assert rooms_reached(load_floorplan(path), path) == len(plan.rooms)
