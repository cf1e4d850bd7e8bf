import numpy as np
import pytest

from anm_gym.metrics.tours import TourSearch
from anm_gym.metrics.view_table import ViewTable, pack
from anm_gym.metrics.ways import WayPlanner
from anm_gym.sim.traversable import TraversableGrid

POSITIONS = np.array([[-4.0, 0.0], [-2.0, 0.0], [0.0, 0.0], [2.0, 0.0], [4.0, 0.0]])
SAMPLES_EACH = 40


@pytest.fixture
def search_for(corridor):
    """Give `search_for(budget)`: five poses along a corridor, 40 samples at each, start at x = 0."""
    grid = TraversableGrid.from_mesh(corridor, 0.0)
    seen = np.repeat(np.eye(5, dtype=bool), SAMPLES_EACH, axis=1)
    table = ViewTable(np.zeros((5 * SAMPLES_EACH, 3)), POSITIONS, np.zeros(1), pack(seen)[:, None])
    planner = WayPlanner(table, grid, waypoint_m=20.0, forward_step_m=0.1, turn_step_rad=np.pi)
    place = planner.place(np.zeros(2), 0.0)

    def make(budget_steps, closed=()):
        is_open = np.array([[row not in closed] for row in range(5)])
        missing = pack(np.ones(5 * SAMPLES_EACH, bool))
        return TourSearch(planner, table.bits, {}, place, missing, is_open, budget_steps)

    return make


def tour_of(*rows):
    return tuple((row, 0) for row in rows)


def test_a_tour_is_worth_the_area_under_its_curve_and_its_end(search_for):
    prospect = search_for(100.0).prospect(tour_of(3))
    cost = 20.0 + 1.0  # 2 m in steps of 10 cm, and a right angle twice in half-turns
    assert prospect.value == pytest.approx(SAMPLES_EACH * (150.0 - cost / 2), rel=0.02)
    assert np.bitwise_count(prospect.left).sum() == 4 * SAMPLES_EACH


def test_what_lies_beyond_the_budget_is_cut(search_for):
    prospect = search_for(45.0).prospect(tour_of(3, 4, 0))
    assert prospect.tour == tour_of(3, 4)


def test_search_finds_the_tour_that_visits_everything(search_for, rng):
    search = search_for(200.0)
    found = search.improved(search.prospect(()), 300, rng)
    assert not found.left.any()
    assert found.value >= search.prospect(tour_of(2, 1, 0, 3, 4)).value


def test_search_shortens_a_detour_and_knows_what_it_is_worth(search_for, rng):
    search = search_for(200.0)
    start = search.prospect(tour_of(0, 4, 1, 3, 2))
    found = search.improved(start, 100, rng)
    assert found.value > start.value
    assert found.value == search.prospect(found.tour).value


def test_closed_poses_are_dropped_and_never_inserted(search_for, rng):
    search = search_for(200.0, closed=(4,))
    assert search.allowed(tour_of(3, 4)) == tour_of(3)
    assert (4, 0) not in search.improved(search.prospect(()), 200, rng).tour


def test_with_nothing_open_the_tour_is_empty(search_for, rng):
    search = search_for(200.0, closed=range(5))
    assert search.improved(search.prospect(()), 10, rng).tour == ()
