"""Which floors of a mesh are storeys: the house before the ground around it, the room before the sky."""

from collections.abc import Callable

import numpy as np
import pytest

from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.storeys import find_storeys, floor_tilt_deg
from anm_gym.sim.traversable import TraversableGrid

BoxRoom = Callable[..., TriangleMesh]


def ground(half_m: float, y_m: float) -> TriangleMesh:
    corners = np.array(
        [[-half_m, y_m, -half_m], [half_m, y_m, -half_m], [half_m, y_m, half_m], [-half_m, y_m, half_m]]
    )
    return TriangleMesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def joined(*meshes: TriangleMesh) -> TriangleMesh:
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]
    return TriangleMesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces).astype(np.int32))


@pytest.mark.parametrize("y_m", [-0.3, -0.02, 0.0])
def test_house_comes_before_the_ground_around_it(box_room: BoxRoom, y_m: float) -> None:
    house = box_room(width_m=6.0, depth_m=5.0)
    mesh = joined(house, ground(40.0, y_m))
    (storey,) = find_storeys(mesh)
    assert storey.floor_y_m == pytest.approx(0.0, abs=0.03)
    assert storey.navigable_area_m2 == pytest.approx(29.0, abs=2.0)
    grid = TraversableGrid.from_mesh(mesh, storey.floor_y_m)
    assert grid.component_at([0.0, 0.0]) == 1
    assert grid.component_at([20.0, 0.0]) == 0, "what is outdoors is no floor"


@pytest.mark.parametrize("has_ceiling", [True, False])
@pytest.mark.parametrize("has_door", [True, False])
def test_open_door_and_missing_ceiling_do_not_lead_outdoors(
    two_rooms: TriangleMesh, has_ceiling: bool, has_door: bool
) -> None:
    """Gazebo's houses have neither ceilings nor anything but a plane around them."""
    house = two_rooms if has_ceiling else without_ceiling(two_rooms)
    low, high = two_rooms.bounds[:, 0]
    is_wall = (house.triangles[:, :, 0] <= low + 0.01).all(axis=1)
    if has_door:
        house = joined(TriangleMesh(house.vertices, house.faces[~is_wall]), with_gap(two_rooms, low))
    (storey,) = find_storeys(joined(house, ground(15.0, 0.0)))
    grid = TraversableGrid.from_mesh(joined(house, ground(15.0, 0.0)), storey.floor_y_m)
    places = grid.frame.centers_of(np.argwhere(grid.component == 1))
    inside = (places[:, 0] > low) & (places[:, 0] < high)
    assert inside.mean() > 0.98
    assert grid.component_areas_m2[0] == pytest.approx(
        TraversableGrid.from_mesh(two_rooms, 0.0).component_areas_m2[0], rel=0.05
    )


def with_gap(room: TriangleMesh, x_m: float) -> TriangleMesh:
    """A wall across x with a door of 1 m in its middle."""
    top, (low, high) = room.bounds[1, 1], room.bounds[:, 2]
    middle = 0.5 * (low + high)
    sides = [(low, middle - 0.5), (middle + 0.5, high)]
    corners = [[x_m, y, z] for z0, z1 in sides for y, z in ((0, z0), (0, z1), (top, z1), (top, z0))]
    faces = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]
    return TriangleMesh(np.array(corners, np.float64), np.array(faces, np.int32))


def test_sky_is_no_room(box_room: BoxRoom) -> None:
    sky = box_room(width_m=60.0, depth_m=60.0, height_m=40.0)
    lowered = TriangleMesh(sky.vertices - np.array([0.0, 15.0, 0.0]), sky.faces)
    (storey,) = find_storeys(joined(box_room(), lowered))
    assert (storey.floor_y_m, storey.ceiling_y_m) == (0.0, 2.5)


def moved(mesh: TriangleMesh, x_m: float, z_m: float) -> TriangleMesh:
    return TriangleMesh(mesh.vertices + np.array([x_m, 0.0, z_m]), mesh.faces)


def without_ceiling(mesh: TriangleMesh) -> TriangleMesh:
    is_ceiling = mesh.triangles[:, :, 1].min(axis=1) >= mesh.bounds[1, 1] - 0.01
    return TriangleMesh(mesh.vertices, mesh.faces[~is_ceiling])


def test_roofed_cupboard_does_not_come_before_a_flat_without_a_ceiling(box_room: BoxRoom) -> None:
    flat = without_ceiling(box_room(width_m=12.0, depth_m=12.0))
    (storey,) = find_storeys(joined(flat, moved(box_room(width_m=3.6, depth_m=3.6), 4.0, 4.0)))
    assert storey.navigable_area_m2 > 100.0


def test_office_in_a_hall_does_not_come_before_the_hall(box_room: BoxRoom) -> None:
    hall = box_room(width_m=30.0, depth_m=30.0, height_m=10.0)
    storeys = find_storeys(joined(hall, moved(box_room(), 10.0, 10.0)))
    assert storeys[0].floor_y_m == 0.0
    assert storeys[0].navigable_area_m2 > 800.0


def test_place_without_any_roof_is_played_where_it_is_largest(box_room: BoxRoom) -> None:
    assert find_storeys(ground(10.0, 1.0))[0].navigable_area_m2 > 300.0
    open_house = box_room(width_m=8.0, depth_m=8.0)
    roofless = TriangleMesh(
        open_house.vertices, open_house.faces[open_house.triangles[:, :, 1].min(axis=1) < 2.0]
    )
    (storey,) = find_storeys(roofless)
    assert storey.ceiling_y_m is None
    assert storey.navigable_area_m2 > 50.0


@pytest.mark.parametrize("tilt_deg", [0.0, 1.0])
def test_rough_floor_of_a_scan_tilts_by_what_it_tilts_in_the_mean(
    rng: np.random.Generator, tilt_deg: float
) -> None:
    side = np.arange(81)
    x, z = (axis.ravel() for axis in np.meshgrid(0.1 * side, 0.1 * side, indexing="ij"))
    y = np.tan(np.deg2rad(tilt_deg)) * (x - 4.0) + rng.normal(0.0, 0.01, len(x))
    first = (81 * side[:-1, None] + side[:-1]).reshape(-1, 1)
    faces = np.concatenate([first + np.array(corners) for corners in ((0, 1, 81), (1, 82, 81))])
    scan = TriangleMesh(np.stack([x, y, z], axis=1), faces.astype(np.int32))
    assert floor_tilt_deg(scan, 0.0) == pytest.approx(tilt_deg, abs=0.15)
