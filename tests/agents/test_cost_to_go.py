import numpy as np
import pytest

from agents.cost_to_go import FAR_M, CostSettings, CostToGo, Floor, cost_to_go
from anm_gym.geometry import forward_xz
from anm_gym.sim.grid import GridFrame

FRAME = GridFrame((0.0, 0.0), 0.05, (80, 120))
"""4 m along z, 6 m along x."""
PLAIN = CostSettings(comfort_m=0.1, tightness_cost=1.0)


def floor(unknown: bool = False) -> Floor:
    """Two rooms with a wall at x = 3 m that leaves a door at the far end, from z = 3.2 to 3.8 m."""
    occupied = np.zeros(FRAME.shape, bool)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    occupied[:64, 60] = occupied[76:, 60] = True
    return Floor(FRAME, occupied, np.full(FRAME.shape, unknown), np.zeros(FRAME.shape, bool))


def to(
    goal: tuple[float, float], settings: CostSettings = PLAIN, tolerance_m: float = 0.0
) -> CostToGo | None:
    return cost_to_go(floor(), (1.0, 1.0), goal, settings, tolerance_m)


def test_cost_of_open_floor_is_its_length() -> None:
    costs = to((2.0, 1.0))
    assert costs is not None
    assert costs.at(np.array([[1.0, 1.0], [1.5, 1.0]])) == pytest.approx([1.0, 0.5], abs=0.06)
    assert costs.end_xz.tolist() == [2.0, 1.0]


def test_descent_looks_towards_the_goal() -> None:
    costs = to((2.0, 1.0))
    assert costs is not None
    heading = costs.heading_at(np.array([[1.0, 1.0]]))[0]
    assert forward_xz(heading) == pytest.approx([1.0, 0.0], abs=0.3)


def test_way_into_the_next_room_goes_through_the_door() -> None:
    costs = to((5.0, 1.0))
    assert costs is not None
    through_the_door = 2.0 * np.hypot(2.0, 2.4)
    assert through_the_door <= costs.at(np.array([[1.0, 1.0]]))[0] < 1.09 * through_the_door


def test_wall_is_far_from_everything() -> None:
    closed = floor()
    closed.occupied[:, 60] = True
    assert cost_to_go(closed, (1.0, 1.0), (5.0, 1.0), PLAIN, 0.0) is None
    costs = cost_to_go(closed, (1.0, 1.0), (2.0, 1.0), PLAIN, 0.0)
    assert costs is not None
    assert costs.at(np.array([[5.0, 1.0]]))[0] == FAR_M


def test_goal_in_a_wall_is_approached_within_the_tolerance() -> None:
    assert to((3.02, 1.0)) is None
    costs = to((3.02, 1.0), tolerance_m=0.3)
    assert costs is not None
    assert np.linalg.norm(costs.end_xz - (3.02, 1.0)) <= 0.3


def test_way_keeps_away_from_walls_if_that_costs_little() -> None:
    costs = to((1.0, 3.0), CostSettings(comfort_m=0.5, tightness_cost=5.0))
    assert costs is not None
    along_the_wall, in_the_open = costs.at(np.array([[0.15, 2.0], [1.0, 2.0]]))
    assert along_the_wall > in_the_open + 0.5


def test_unknown_floor_costs_more_or_is_forbidden() -> None:
    hidden = floor(unknown=True)
    hidden.unknown[:, :30] = False
    dear = cost_to_go(hidden, (1.0, 1.0), (2.0, 1.0), CostSettings(unknown_cost=4.0), 0.0)
    assert dear is not None
    assert dear.at(np.array([[1.0, 1.0]]))[0] == pytest.approx(0.5 + 4.0 * 0.5, abs=0.2)
    assert cost_to_go(hidden, (1.0, 1.0), (2.0, 1.0), CostSettings(unknown_cost=None), 0.0) is None


def test_agent_that_stands_too_close_to_a_wall_gets_away() -> None:
    costs = cost_to_go(floor(), (1.0, 0.07), (2.0, 1.0), PLAIN, 0.0)
    assert costs is not None
    assert costs.at(np.array([[1.0, 0.12]]))[0] < 2.0


def test_agent_can_go_back_the_way_it_came() -> None:
    sealed = floor()
    sealed.occupied[:, 60] = True
    sealed.stood[18:23, 55:66] = True
    assert cost_to_go(sealed, (1.0, 1.0), (5.0, 1.0), PLAIN, 0.0) is not None


def test_beyond_the_raster_all_is_unknown() -> None:
    window = floor().window((6.5, 1.0), 1.0)
    cells = window.frame.cells_of([(6.9, 1.0), (5.7, 1.0), (5.97, 1.0)])
    assert window.unknown[cells[:, 0], cells[:, 1]].tolist() == [True, False, False]
    assert window.occupied[cells[:, 0], cells[:, 1]].tolist() == [False, False, True]


def test_window_that_is_too_small_is_widened() -> None:
    costs = to((3.3, 1.0), CostSettings(comfort_m=0.1, tightness_cost=1.0, margin_m=0.3))
    assert costs is not None
    assert costs.at(np.array([[1.0, 1.0]]))[0] > 4.0
