import copy

import numpy as np
import pytest

from anm_gym.errors import SceneError
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.traversable import BodySpec, TraversableGrid


@pytest.fixture
def room(box_room):
    return TraversableGrid.from_mesh(box_room(), 0.0)


def with_box(room: TriangleMesh, low, high) -> TriangleMesh:
    """Add an axis-aligned solid to a mesh."""
    index = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]])
    index = np.concatenate([index, [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]])
    corners = np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
    faces = np.concatenate([room.faces, index + len(room.vertices)]).astype(np.int32)
    return TriangleMesh(np.concatenate([room.vertices, corners]), faces)


def test_the_body_stays_its_radius_from_the_walls_of_a_closed_room(room):
    side_m = np.sqrt(room.navigable_area_m2)
    assert abs(side_m - (4.0 - 2 * 0.1)) <= 0.1, "within a cell on either side"
    assert len(room.component_areas_m2) == 1
    assert room.is_navigable((0.0, 0.0))
    assert not room.is_navigable((1.96, 0.0))
    assert not room.is_navigable((9.0, 0.0))


def test_clearance_is_the_distance_to_the_nearest_wall(room):
    assert room.clearance_at((0.0, 0.0)) == pytest.approx(2.0, abs=0.05)
    assert room.clearance_at((1.5, 0.3)) == pytest.approx(0.5, abs=0.05)
    assert room.clearance_at((-1.0, -1.75)) == pytest.approx(0.25, abs=0.05)
    assert room.clearance_at((30.0, 0.0)) == 0.0


def test_clearance_between_cells_is_interpolated(room):
    here, there = room.clearance_at((1.525, 0.0)), room.clearance_at((1.575, 0.0))
    assert room.clearance_at((1.55, 0.0)) == pytest.approx((here + there) / 2, abs=1e-6)


def test_a_wall_of_a_millimetre_separates_two_parts(box_room):
    mesh = with_box(box_room(), (0.712, 0.0, -2.0), (0.713, 2.5, 2.0))
    grid = TraversableGrid.from_mesh(mesh, 0.0)
    assert len(grid.component_areas_m2) == 2
    assert grid.component_at((-1.0, 0.0)) == 1, "the larger part comes first"
    assert grid.component_at((1.5, 0.0)) == 2
    assert grid.component_areas_m2[0] > grid.component_areas_m2[1]


def test_a_solid_block_is_occupied_at_its_border_and_its_inside_is_another_part(box_room):
    grid = TraversableGrid.from_mesh(with_box(box_room(), (-0.5, 0.0, -0.5), (0.5, 2.0, 0.5)), 0.0)
    assert grid.component_at((0.0, 0.0)) == 2, "the inside cannot be reached"
    assert grid.component_at((1.5, 0.0)) == 1


@pytest.mark.parametrize(
    ("low_y", "high_y", "blocks"), [(0.0, 0.09, False), (0.0, 0.3, True), (1.6, 2.0, False), (1.4, 2.0, True)]
)
def test_what_is_stepped_over_or_hangs_overhead_does_not_block(box_room, low_y, high_y, blocks):
    grid = TraversableGrid.from_mesh(with_box(box_room(), (-0.1, low_y, -2.0), (0.1, high_y, 2.0)), 0.0)
    assert (len(grid.component_areas_m2) > 1) == blocks


def test_a_door_joins_two_rooms(two_rooms):
    grid = TraversableGrid.from_mesh(two_rooms, 0.0)
    assert len(grid.component_areas_m2) == 1
    assert grid.is_navigable((0.0, 0.0))
    assert not grid.is_navigable((0.0, 1.0))


def test_a_body_wider_than_the_door_stays_in_its_room(two_rooms):
    grid = TraversableGrid.from_mesh(two_rooms, 0.0, BodySpec(radius_m=0.55))
    assert len(grid.component_areas_m2) == 2


def test_a_place_where_the_body_fits_has_a_cell(two_rooms, rng):
    grid = TraversableGrid.from_mesh(two_rooms, 0.0)
    for position in rng.uniform([-4.2, -2.2], [4.2, 2.2], (500, 2)):
        cell = grid.cell_at(position)
        if grid.is_navigable(position):
            assert cell is not None
            assert grid.navigable[tuple(cell)]
            assert np.abs(grid.frame.centers_of(cell)[0] - position).max() <= grid.frame.cell_m
        assert (grid.component_at(position) > 0) == grid.is_navigable(position)


def test_a_place_far_from_any_floor_has_no_cell(room):
    assert room.cell_at((50.0, 50.0)) is None


def test_positions_are_drawn_from_the_whole_part_and_repeat_with_the_seed(room):
    drawn = [room.sample_position(np.random.default_rng(3)) for _ in range(2)]
    np.testing.assert_array_equal(*drawn)
    generator = np.random.default_rng(4)
    positions = np.array([room.sample_position(generator) for _ in range(300)])
    assert all(room.is_navigable(position) for position in positions)
    assert (positions.min(axis=0) < -1.6).all()
    assert (positions.max(axis=0) > 1.6).all()


def test_a_part_that_does_not_exist_cannot_be_drawn_from(room, rng):
    with pytest.raises(SceneError, match="navigable part 2, got 1 parts"):
        room.sample_position(rng, component=2)


def test_a_storey_needs_a_floor(box_room):
    with pytest.raises(SceneError, match=r"must have a floor at y = 7\.00 m"):
        TraversableGrid.from_mesh(box_room(), 7.0)


def test_a_mesh_in_millimetres_is_refused_before_it_fills_the_memory(box_room):
    mesh = TriangleMesh(1000.0 * box_room().vertices, box_room().faces)
    with pytest.raises(
        SceneError, match=r"at most 25000000 cells, got 4000 x 4000 m .* check the mesh's `unit`"
    ):
        TraversableGrid.from_mesh(mesh, 0.0)


def test_a_body_survives_a_deep_copy():
    body = BodySpec(radius_m=0.2)
    assert copy.deepcopy(body) == body


@pytest.mark.parametrize("settings", [{"radius_m": 0.0}, {"climb_m": 1.5}, {"climb_m": -0.1}])
def test_a_body_must_have_sensible_measures(settings):
    with pytest.raises(ValueError, match="`radius_m` must be > 0 and `climb_m` in"):
        BodySpec(**settings)
