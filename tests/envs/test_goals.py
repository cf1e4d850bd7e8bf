"""Point goals: exact distances where they are known, and draws within their range."""

from collections.abc import Callable

import numpy as np
import pytest

from anm_gym.envs.goals import DistanceToPoint, GoalRange, draw_goal
from anm_gym.errors import EpisodeError
from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.simulator import Simulator

CAMERA = CameraSpec(width_px=4, height_px=4)


@pytest.fixture
def simulator(two_rooms: TriangleMesh) -> Simulator:
    return Simulator(two_rooms, 0.0, CAMERA)


def distance_m(simulator: Simulator, from_xz: tuple[float, float], to_xz: tuple[float, float]) -> float:
    return DistanceToPoint(simulator.grid, simulator.graph, to_xz)(from_xz)


@pytest.mark.parametrize("angle_rad", np.arange(0.0, 6.2, 0.4).tolist())
def test_distance_within_a_room_is_the_straight_line(simulator: Simulator, angle_rad: float) -> None:
    goal = (2.0 + 1.7 * np.cos(angle_rad), 1.7 * np.sin(angle_rad))
    assert distance_m(simulator, (2.0, 0.0), goal) == pytest.approx(1.7, abs=1e-9)


def test_distance_round_a_corner_is_that_of_the_taut_string(simulator: Simulator) -> None:
    """From room to room past the edge of the door, which the body passes at its radius."""
    leg_m = np.hypot(2.0, 1.5 - 0.4)
    assert distance_m(simulator, (-2.0, 1.5), (2.0, 1.5)) == pytest.approx(2.0 * leg_m, abs=0.12)


def test_distance_is_symmetric_and_zero_at_the_goal(simulator: Simulator) -> None:
    there, back = (distance_m(simulator, *ends) for ends in (((-2, 1), (3, 0.5)), ((3, 0.5), (-2, 1))))
    assert there == pytest.approx(back, abs=0.05)
    assert distance_m(simulator, (1.0, 1.0), (1.0, 1.0)) == 0.0


def test_distance_to_nowhere_is_infinite(simulator: Simulator) -> None:
    assert distance_m(simulator, (9.0, 9.0), (1.0, 1.0)) == float("inf")


def test_path_has_the_corners_of_the_door_only(simulator: Simulator) -> None:
    distance = DistanceToPoint(simulator.grid, simulator.graph, (2.0, 1.5))
    path = distance.path_from((-2.0, 1.5))
    assert path is not None
    np.testing.assert_allclose(path[[0, -1]], [[-2.0, 1.5], [2.0, 1.5]])
    assert len(path) <= 5
    assert (np.abs(path[1:-1, 0]) < 0.3).all()
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() == pytest.approx(distance((-2.0, 1.5)))


def test_distance_does_not_depend_on_what_was_asked_before(simulator: Simulator) -> None:
    asked, fresh = (DistanceToPoint(simulator.grid, simulator.graph, (2.0, 1.5)) for _ in range(2))
    for x in np.linspace(-3.0, 1.0, 9):
        asked((x, -1.0 if x < -0.5 else 0.0))
    assert asked((-2.0, 1.5)) == fresh((-2.0, 1.5))


def test_drawn_goals_are_in_range_and_mostly_winding(simulator: Simulator, rng: np.random.Generator) -> None:
    start, limits = np.array([2.0, 1.5]), GoalRange(1.0, 4.5)
    goals = [draw_goal(simulator.grid, simulator.graph, start, limits, rng) for _ in range(30)]
    lengths = np.array([distance_m(simulator, tuple(start), tuple(goal)) for goal in goals])
    ratios = lengths / np.linalg.norm(np.array(goals) - start, axis=1)
    assert lengths.min() >= 1.0
    assert lengths.max() <= 4.5
    assert np.median(ratios) > 1.1
    assert all(simulator.grid.is_navigable(goal) for goal in goals)


def test_empty_room_has_goals_too(box_room: Callable[..., TriangleMesh], rng: np.random.Generator) -> None:
    simulator = Simulator(box_room(), 0.0, CAMERA)
    goal = draw_goal(simulator.grid, simulator.graph, np.zeros(2), GoalRange(), rng)
    assert np.linalg.norm(goal) >= 1.0


def test_room_too_small_for_the_range_is_refused(simulator: Simulator, rng: np.random.Generator) -> None:
    with pytest.raises(EpisodeError, match=r"a goal must lie 50.0 to 60.0 m from the start.*min_distance_m"):
        draw_goal(simulator.grid, simulator.graph, np.array([2.0, 0.0]), GoalRange(50.0, 60.0), rng)


@pytest.mark.parametrize("limits", [(0.0, 1.0), (2.0, 2.0), (-1.0, 3.0)])
def test_impossible_range_is_refused(limits: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="`min_distance_m` must be > 0 and less than `max_distance_m`"):
        GoalRange(*limits)
