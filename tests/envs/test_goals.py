"""Point goals: draws within their range, and mostly not straight ahead."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from anm_gym.envs.goals import GoalRange, draw_ends, draw_goal
from anm_gym.errors import EpisodeError
from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.point_distance import DistanceToPoint
from anm_gym.sim.simulator import Simulator

CAMERA = CameraSpec(width_px=4, height_px=4)


@pytest.fixture
def simulator(two_rooms: TriangleMesh) -> Simulator:
    return Simulator(two_rooms, 0.0, CAMERA)


def test_drawn_goals_are_in_range_and_mostly_winding(simulator: Simulator, rng: np.random.Generator) -> None:
    start, limits = np.array([2.0, 1.5]), GoalRange(1.0, 4.5)
    goals = [draw_goal(simulator.grid, simulator.graph, start, limits, rng) for _ in range(30)]
    from_start = DistanceToPoint(simulator.grid, simulator.graph, start)
    lengths = np.array([from_start(goal) for goal in goals])
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


def test_first_start_that_has_a_goal_is_taken(simulator: Simulator) -> None:
    starts, limits = np.array([[0.2, 0.0], [-3.5, -1.5], [3.5, 1.5]]), GoalRange(6.5, 9.0)
    asked = []

    def ask() -> Iterator[NDArray[np.float64]]:
        for start in starts:
            asked.append(start)
            yield start

    first, second = np.random.default_rng(1), np.random.default_rng(1)
    start, goal = draw_ends(ask(), simulator.grid, simulator.graph, limits, first)
    np.testing.assert_array_equal(asked, starts[:2])
    np.testing.assert_array_equal(start, starts[1])
    # A start without a goal draws nothing.
    expected = draw_goal(simulator.grid, simulator.graph, starts[1], limits, second)
    np.testing.assert_array_equal(goal, expected)


def test_starts_without_a_goal_are_an_error_about_the_last(
    simulator: Simulator, rng: np.random.Generator
) -> None:
    starts = np.array([[2.0, 0.0], [1.0, 0.5]])
    with pytest.raises(EpisodeError, match=r"a goal must lie 50.0 to 60.0 m.*\[1.0, 0.5\]"):
        draw_ends(starts, simulator.grid, simulator.graph, GoalRange(50.0, 60.0), rng)


@pytest.mark.parametrize("limits", [(0.0, 1.0), (2.0, 2.0), (-1.0, 3.0), (1.0, np.inf), (np.nan, 3.0)])
def test_impossible_range_is_refused(limits: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="`min_distance_m` must be > 0 and less than `max_distance_m`"):
        GoalRange(*limits)
