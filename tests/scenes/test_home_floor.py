"""The floor raster of a room refuses what would cut a door off."""

import numpy as np
import pytest
from numpy.typing import NDArray

from anm_gym.scenes.procedural.fittings import ceiling_lights, door_leaves, window_fittings
from anm_gym.scenes.procedural.floor import Pose, RoomFloor
from anm_gym.scenes.procedural.furnish import furnish
from anm_gym.scenes.procedural.furniture.piece import Style
from anm_gym.scenes.procedural.layout import plan_home
from anm_gym.scenes.procedural.openings import find_walls
from anm_gym.scenes.procedural.palette import WOODS, draw_colors
from anm_gym.scenes.procedural.plan import OUTSIDE, Layout, Opening, Rect, Room, Wall


def footprint(width: float, depth: float) -> NDArray[np.float64]:
    """One rectangle centred over the origin."""
    return np.array([[-width / 2, -depth / 2, width / 2, depth / 2]])


@pytest.fixture
def layout() -> Layout:
    """A room of 4 x 3 m with a door in the middle of its left and of its right wall and a window above."""
    rooms = (
        Room("living", (Rect(0, 0, 400, 300),), 250),
        Room("corridor", (Rect(-150, 0, 0, 300),), 250),
        Room("corridor", (Rect(400, 0, 550, 300),), 250),
    )
    doors = (
        Opening("door", Wall(False, 0, 0, 300, (1, 0)), 105, 195, 0, 200),
        Opening("door", Wall(False, 400, 0, 300, (0, 2)), 105, 195, 0, 200),
    )
    window = Opening("window", Wall(True, 300, 0, 400, (0, OUTSIDE)), 130, 270, 90, 210)
    return Layout("flat", 0, 0.0, rooms, find_walls(rooms), doors, (window,))


@pytest.fixture
def floor(layout: Layout) -> RoomFloor:
    return RoomFloor(layout, 0)


@pytest.fixture
def style(rng: np.random.Generator) -> Style:
    return Style(draw_colors("living", WOODS[0], rng), 2.5)


def test_floor_area_is_the_room_without_its_walls(floor: RoomFloor) -> None:
    assert floor.inside.sum() * 0.05**2 == pytest.approx((4.0 - 0.1) * (3.0 - 0.2))


def test_table_in_the_middle_is_taken_once(floor: RoomFloor) -> None:
    table = footprint(0.8, 0.6)
    assert floor.try_take(table, Pose(2.0, 1.5, 0.3), 0.0, False)
    assert not floor.try_take(table, Pose(2.1, 1.5, 0.0), 0.0, False)


def test_wall_of_shelves_between_two_doors_is_refused(floor: RoomFloor) -> None:
    assert not floor.try_take(footprint(0.4, 2.7), Pose(2.0, 1.5, 0.0), 0.0, False)
    assert not floor.taken.any()


def test_gap_that_is_too_narrow_to_walk_is_refused(floor: RoomFloor) -> None:
    assert not floor.try_take(footprint(0.4, 2.2), Pose(2.0, 0.1 + 1.1, 0.0), 0.0, False)
    assert floor.try_take(footprint(0.4, 1.9), Pose(2.0, 0.1 + 0.96, 0.0), 0.0, False)


def test_nothing_stands_before_a_door(floor: RoomFloor) -> None:
    assert not floor.try_take(footprint(0.3, 0.3), Pose(0.4, 1.5, 0.0), 0.0, False)


def test_nothing_stands_in_a_wall(floor: RoomFloor) -> None:
    assert not floor.try_take(footprint(0.3, 0.3), Pose(2.0, 0.2, 0.0), 0.0, False)


def test_tall_piece_leaves_the_window_free(floor: RoomFloor) -> None:
    pose = Pose(2.0, 2.6, 0.0)
    assert not floor.try_take(footprint(0.8, 0.4), pose, 0.0, True)
    assert floor.try_take(footprint(0.8, 0.4), pose, 0.0, False)


def test_floor_before_a_wardrobe_stays_free(floor: RoomFloor) -> None:
    assert floor.try_take(footprint(1.0, 0.5), Pose(2.0, 0.4, 0.0), 0.5, True)
    assert not floor.try_take(footprint(0.3, 0.2), Pose(2.0, 0.9, 0.0), 0.0, False)


def test_wardrobe_is_refused_where_its_front_is_taken(floor: RoomFloor) -> None:
    assert floor.try_take(footprint(0.5, 0.3), Pose(2.0, 1.0, 0.0), 0.0, False)
    assert not floor.try_take(footprint(1.0, 0.5), Pose(2.0, 0.4, 0.0), 0.5, True)


def test_radiator_may_stand_in_the_zone_of_the_window_but_not_cut_a_door_off(floor: RoomFloor) -> None:
    assert floor.try_take_fixture(footprint(1.0, 0.12), Pose(2.0, 2.8, 0.0))
    assert not floor.try_take_fixture(footprint(0.1, 1.0), Pose(0.3, 1.5, 0.0))


def test_picture_hangs_on_bare_walls_only(floor: RoomFloor) -> None:
    assert floor.has_free_wall(-0.4, 0.4, Pose(2.0, 0.12, 0.0))
    assert not floor.has_free_wall(-0.4, 0.4, Pose(2.0, 2.88, np.pi))


def test_free_positions_are_inside_and_free(floor: RoomFloor, rng: np.random.Generator) -> None:
    floor.try_take(footprint(1.0, 1.0), Pose(2.0, 1.5, 0.0), 0.0, False)
    for x, z in (floor.free_position(rng) for _ in range(50)):
        assert 0.0 < x < 4.0
        assert 0.0 < z < 3.0
        assert max(abs(x - 2.0), abs(z - 1.5)) > 0.5


def test_roomiest_place_is_far_from_walls_and_doors(floor: RoomFloor) -> None:
    x, z = floor.roomiest()
    assert 1.2 < x < 2.8
    assert 1.0 < z < 2.0


def test_door_leaf_hangs_at_its_door_and_opens_into_the_first_room(
    layout: Layout, style: Style, rng: np.random.Generator
) -> None:
    leaves = [leaf for _ in range(20) for leaf in door_leaves(layout, 0, style, rng)]
    assert leaves
    for leaf in leaves:
        tip = leaf.piece.solid.turned(leaf.pose.angle_rad).moved(leaf.pose.x_m, 0.0, leaf.pose.z_m)
        assert 3.0 < tip.low[0] < tip.high[0] < 4.0
        assert min(abs(leaf.pose.z_m - 1.05), abs(leaf.pose.z_m - 1.95)) < 0.05


def test_window_gets_a_frame_before_its_pane(layout: Layout, style: Style, rng: np.random.Generator) -> None:
    frame = next(iter(window_fittings(layout, 0, style, rng)))
    solid = frame.piece.solid.turned(frame.pose.angle_rad).moved(frame.pose.x_m, 0.0, frame.pose.z_m)
    assert 1.3 - 1e-9 <= solid.low[0] < solid.high[0] <= 2.7 + 1e-9
    assert solid.high[2] == pytest.approx(3.04)


def test_lights_hang_under_the_ceiling(layout: Layout, style: Style, rng: np.random.Generator) -> None:
    (light,) = ceiling_lights(layout, 0, style, rng)
    assert (light.pose.x_m, light.pose.z_m) == (2.0, 1.5)
    assert light.piece.solid.high[1] == pytest.approx(2.5)


def test_furniture_stays_inside_its_home() -> None:
    layout = plan_home("flat", 3)
    rng = np.random.default_rng(0)
    placements = furnish(layout, tuple(draw_colors(room.kind, WOODS[0], rng) for room in layout.rooms))
    for placement in placements:
        corners = np.concatenate([rect.corners_cm for rect in layout.rooms[placement.room].rects]) / 100.0
        assert (placement.solid.low[[0, 2]] > corners.min(axis=0) - 0.1).all()
        assert (placement.solid.high[[0, 2]] < corners.max(axis=0) + 0.1).all()
