"""Plans of homes: sizes, walls, doors and loops."""

import numpy as np
import pytest

from anm_gym.scenes.procedural.layout import plan_home, stream
from anm_gym.scenes.procedural.openings import find_walls, place_doors
from anm_gym.scenes.procedural.partition import Cell, misfit, subdivide
from anm_gym.scenes.procedural.plan import OUTSIDE, Layout, Opening, Rect, Room, Wall
from anm_gym.scenes.procedural.tiers import CORRIDOR, TIERS, tier_spec

SEEDS = range(12)


def two_rooms() -> tuple[Room, ...]:
    """A living room of 4 x 3 m and a bedroom of 3 x 3 m beside it."""
    return (
        Room("living", (Rect(0, 0, 400, 300),), 260),
        Room("bedroom", (Rect(400, 0, 700, 300),), 260),
    )


def reached(layout: Layout) -> set[int]:
    """Rooms that the doors connect with the first room."""
    found, waiting = {0}, [0]
    while waiting:
        room = waiting.pop()
        for door in layout.doors:
            if room in door.rooms:
                new = set(door.rooms) - found
                found |= new
                waiting += new
    return found


@pytest.mark.parametrize("tier", TIERS)
def test_sizes_stay_within_the_tier(tier: str) -> None:
    spec = TIERS[tier]
    for layout in (plan_home(tier, seed) for seed in SEEDS):
        assert spec.area_m2[0] <= layout.area_m2 <= spec.area_m2[1]
        assert spec.num_rooms[0] <= layout.num_rooms <= spec.num_rooms[1]


@pytest.mark.parametrize("tier", TIERS)
def test_doors_connect_all_rooms(tier: str) -> None:
    for layout in (plan_home(tier, seed) for seed in SEEDS):
        assert reached(layout) == set(range(len(layout.rooms)))


@pytest.mark.parametrize("tier", ["house", "maze"])
def test_large_homes_have_loops_and_corridors(tier: str) -> None:
    for layout in (plan_home(tier, seed) for seed in SEEDS):
        assert layout.num_loops >= 1
        assert any(room.is_corridor for room in layout.rooms)


def test_some_homes_have_rooms_with_a_corner() -> None:
    assert any(len(room.rects) == 2 for seed in SEEDS for room in plan_home("house", seed).rooms)


def test_some_homes_are_turned_and_some_are_not() -> None:
    turned = {plan_home("flat", seed).yaw_rad != 0.0 for seed in SEEDS}
    assert turned == {True, False}


@pytest.mark.parametrize("tier", TIERS)
def test_doors_have_the_size_of_doors_and_lie_within_their_wall(tier: str) -> None:
    for layout in (plan_home(tier, seed) for seed in SEEDS):
        for door in layout.doors:
            assert door.wall.low_cm + 10 < door.low_cm < door.high_cm < door.wall.high_cm - 10
            assert door.width_m >= 0.8
            assert door.height_m >= 2.0
            if door.kind == "door":
                assert door.width_m <= 1.0
                assert door.height_m <= 2.1


@pytest.mark.parametrize("tier", TIERS)
def test_windows_lie_in_outer_walls_below_the_ceiling(tier: str) -> None:
    for layout in (plan_home(tier, seed) for seed in SEEDS):
        for window in layout.windows:
            assert OUTSIDE in window.rooms
            assert window.wall.low_cm < window.low_cm < window.high_cm < window.wall.high_cm
            assert window.top_cm < layout.rooms[max(window.rooms)].ceiling_cm


@pytest.mark.parametrize("tier", TIERS)
def test_each_home_has_one_entrance(tier: str) -> None:
    kinds = [opening.kind for opening in plan_home(tier, 1).windows]
    assert kinds.count("entrance") == 1


def test_ceilings_are_between_240_and_300_cm() -> None:
    heights = [room.ceiling_cm for seed in SEEDS for room in plan_home("house", seed).rooms]
    assert 240 <= min(heights) <= max(heights) <= 300


def test_rooms_do_not_overlap() -> None:
    rects = [rect for room in plan_home("maze", 0).rooms for rect in room.rects]
    for index, first in enumerate(rects):
        for second in rects[:index]:
            apart_x = first.x1 <= second.x0 or second.x1 <= first.x0
            apart_z = first.z1 <= second.z0 or second.z1 <= first.z0
            assert apart_x or apart_z


def test_two_rooms_share_one_wall_and_have_six_outer_ones() -> None:
    walls = find_walls(two_rooms())
    shared = [wall for wall in walls if not wall.is_exterior]
    assert shared == [Wall(False, 400, 0, 300, (0, 1))]
    assert len(walls) - len(shared) == 6
    assert sum(wall.length_cm for wall in walls if wall.is_exterior) == 2 * (700 + 300)


def test_wall_footprint_reaches_over_its_ends() -> None:
    assert Wall(False, 400, 0, 300, (0, 1)).solid_cm() == Rect(395, -5, 405, 305)
    assert Wall(True, 0, 0, 400, (OUTSIDE, 0)).solid_cm() == Rect(-10, -10, 410, 10)


def test_rooms_that_touch_too_little_get_no_doors(rng: np.random.Generator) -> None:
    rooms = (Room("living", (Rect(0, 0, 300, 300),), 260), Room("bedroom", (Rect(300, 200, 600, 500),), 260))
    assert place_doors(rooms, find_walls(rooms), TIERS["flat"], rng) is None


def test_two_rooms_get_one_door_in_their_wall(rng: np.random.Generator) -> None:
    rooms = two_rooms()
    placed = place_doors(rooms, find_walls(rooms), TIERS["house"], rng)
    assert placed is not None
    (door,), _ = placed
    assert door.rooms == (0, 1)


def test_bedrooms_hang_on_the_corridor_rather_than_on_the_bathroom(rng: np.random.Generator) -> None:
    rooms = (
        Room(CORRIDOR, (Rect(0, 0, 600, 120),), 240),
        Room("bedroom", (Rect(0, 120, 300, 500),), 260),
        Room("bathroom", (Rect(300, 120, 600, 500),), 240),
    )
    placed = place_doors(rooms, find_walls(rooms), TIERS["flat"], rng)
    assert placed is not None
    assert {door.rooms for door in placed[0]} >= {(0, 1), (0, 2)}


def test_subdivision_keeps_the_area_and_gives_each_room(rng: np.random.Generator) -> None:
    kinds = ("living", "bedroom", "kitchen", "bathroom", "office", "kids")
    block = Rect(0, 0, 1200, 900)
    cells = subdivide(block, kinds, 5, rng)
    assert sum(rect.area_m2 for cell in cells for rect in cell.rects) == pytest.approx(block.area_m2)
    assert sorted(cell.kind for cell in cells if cell.kind != CORRIDOR) == sorted(kinds)
    assert sum(cell.kind == CORRIDOR for cell in cells) == 1


def test_no_corridor_is_made_where_there_is_no_space(rng: np.random.Generator) -> None:
    cells = subdivide(Rect(0, 0, 500, 400), ("living", "bedroom", "kitchen", "bathroom"), 4, rng)
    assert CORRIDOR not in {cell.kind for cell in cells}


def test_narrow_and_long_rooms_fit_badly() -> None:
    good = misfit([Cell("bedroom", (Rect(0, 0, 400, 400),))])
    narrow = misfit([Cell("bedroom", (Rect(0, 0, 140, 400),))])
    assert good == 0.0
    assert narrow == pytest.approx(10.0 * (280 - 140) / 280 + 400 / 140 - 2.0)


def test_door_vectors_lead_from_the_first_room_to_the_second() -> None:
    for seed in range(6):
        layout = plan_home("flat", seed)
        for door, center, step in zip(
            layout.doors, layout.door_centers_xz(), layout.door_directions_xz(), strict=True
        ):
            for room, sign in zip(door.rooms, (-1.0, 1.0), strict=True):
                assert any(
                    _is_inside(polygon, center + 0.3 * sign * step)
                    for polygon in layout.room_polygons_xz(room)
                )


def _is_inside(polygon: np.ndarray, point: np.ndarray) -> bool:
    """Whether a point lies in a rectangle of any turn."""
    first, second = polygon[1] - polygon[0], polygon[3] - polygon[0]
    offset = point - polygon[0]
    return bool(0 < offset @ first < first @ first and 0 < offset @ second < second @ second)


def test_world_points_are_turned_counter_clockwise_about_y() -> None:
    rooms = two_rooms()
    layout = Layout("flat", 0, np.pi / 2, rooms, find_walls(rooms), (), ())
    assert layout.center_cm == (350.0, 150.0)
    np.testing.assert_allclose(layout.world_xz([450.0, 150.0]), [0.0, -1.0], atol=1e-12)
    np.testing.assert_allclose(layout.room_center_xz(0), [0.0, 1.5], atol=1e-12)


def test_opening_knows_its_size_and_side() -> None:
    wall = Wall(True, 300, 0, 400, (0, OUTSIDE))
    window = Opening("window", wall, 100, 250, 90, 210)
    assert (window.width_m, window.height_m) == (1.5, 1.2)
    assert (window.center_cm, window.inward) == ((175.0, 300.0), -1)


def test_streams_of_stages_differ() -> None:
    draws = {stream("flat", 3, *stage).random() for stage in ((0,), (1,), (2, 0), (2, 1))}
    assert len(draws) == 4


def test_unknown_tier_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown tier 'villa'"):
        tier_spec("villa")
