import numpy as np
import pytest

from anm_gym.mesh import TriangleMesh
from anm_gym.metrics import ways
from anm_gym.metrics.view_table import ViewTable, pack
from anm_gym.metrics.ways import WayPlanner
from anm_gym.sim.traversable import TraversableGrid

POSITIONS = np.array([[-4.0, 0.0], [-2.0, 0.0], [0.0, 0.0], [2.0, 0.0], [4.0, 0.0]])
LEFT, AHEAD_X = 1, 3  # of four headings: along -x, along +x


@pytest.fixture
def table():
    """Give five positions along a corridor; each pose covers the one sample that bears its number."""
    bits = pack(np.eye(20, dtype=bool)).reshape(5, 4, 1)
    return ViewTable(np.zeros((20, 3)), POSITIONS, np.arange(4) * np.pi / 2, bits)


@pytest.fixture
def planner(table, corridor):
    grid = TraversableGrid.from_mesh(corridor, 0.0)
    return WayPlanner(table, grid, waypoint_m=2.0, forward_step_m=0.1, turn_step_rad=np.pi / 18)


def test_a_straight_way_costs_its_length_and_its_turns(planner, table):
    place = planner.place(np.array([-4.0, 0.0]), -np.pi / 2)
    way = planner.way(place, (4, AHEAD_X), table.bits)
    assert way.cost_steps == pytest.approx(80.0, rel=0.02, abs=3.0)
    back = planner.way(place, (4, LEFT), table.bits)
    assert back.cost_steps == pytest.approx(way.cost_steps + 18.0, abs=2.0)


def test_the_poses_on_the_way_and_of_the_turn_count(planner, table):
    place = planner.place(np.array([-4.0, 0.0]), -np.pi / 2)
    bits = planner.way(place, (4, 0), table.bits).bits
    seen = np.flatnonzero(np.unpackbits(bits.view(np.uint8), bitorder="little"))
    assert seen.tolist() == [4 + AHEAD_X, 8 + AHEAD_X, 12 + AHEAD_X, 16 + 0, 16 + AHEAD_X]


def test_turning_in_place_costs_its_angle_alone(planner, table):
    place = planner.place_at((2, 0))
    assert planner.way(place, (2, 1), table.bits).cost_steps == pytest.approx(9.0, abs=1e-9)


def test_direct_costs_are_those_of_straight_ways(planner, table):
    place = planner.place_at((0, AHEAD_X))
    costs = planner.direct_costs(place)
    assert costs.shape == (5, 4)
    assert costs[3, AHEAD_X] == pytest.approx(60.0, abs=2.0)
    assert costs[3, LEFT] == pytest.approx(78.0, abs=2.0)
    assert costs[0, AHEAD_X] == pytest.approx(0.0, abs=1e-9)


def test_beside_the_floor_there_is_no_place(planner):
    assert planner.place(np.array([0.0, 30.0]), 0.0) is None


def test_positions_are_found_by_distance(planner):
    assert sorted(planner.positions_within(np.array([-3.0, 0.0]), 1.1)) == [0, 1]


def test_large_floors_are_planned_on_wider_cells_at_about_the_same_cost(table, corridor, monkeypatch):
    grid = TraversableGrid.from_mesh(corridor, 0.0)
    costs = []
    for max_cells in (10**9, 1):
        monkeypatch.setattr(ways, "_MAX_CELLS", max_cells)
        planner = WayPlanner(table, grid, forward_step_m=0.1, turn_step_rad=np.pi / 18)
        start = planner.place(np.array([-4.0, 0.0]), -np.pi / 2)
        costs.append(planner.way(start, (4, AHEAD_X), table.bits).cost_steps)
    assert planner.place_at((0, 0)).tree.distance_m.size < grid.component.size / 3
    assert costs[1] == pytest.approx(costs[0], rel=0.1)


@pytest.mark.parametrize("angle_deg", range(0, 90, 6))
def test_wider_cells_do_not_open_thin_walls(table, box_room, monkeypatch, angle_deg):
    """A sheet across a room, as thin as can be, under any angle."""
    monkeypatch.setattr(ways, "_MAX_CELLS", 1)
    along = np.array([np.cos(np.deg2rad(angle_deg)), 0.0, np.sin(np.deg2rad(angle_deg))])
    corners = [sign * 9.0 * along + [0.013, y, 0.021] for sign in (-1, 1) for y in (0.0, 2.5)]
    room = box_room(width_m=8.0, depth_m=8.0)
    sheet = np.array([[0, 1, 2], [1, 2, 3]], np.int32) + len(room.vertices)
    mesh = TriangleMesh(np.vstack([room.vertices, corners]), np.vstack([room.faces, sheet]))
    across = 1.5 * np.array([-along[2], along[0]])
    ends = ViewTable(table.points, np.stack([across + 0.3, -across]), table.headings_rad, table.bits[:2])
    planner = WayPlanner(ends, TraversableGrid.from_mesh(mesh, 0.0))
    costs = planner.direct_costs(planner.place(across, 0.0))
    assert np.isfinite(costs[0]).all()
    assert np.isinf(costs[1]).all()
