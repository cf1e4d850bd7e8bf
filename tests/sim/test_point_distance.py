"""Distances along the floor: exact where they are known, along ways that the body can go."""

import numpy as np
import pytest

from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.catalog import make_scene
from anm_gym.sim.point_distance import DistanceToPoint
from anm_gym.sim.simulator import Simulator
from anm_gym.sim.traversable import TraversableGrid

CAMERA = CameraSpec(width_px=4, height_px=4)


@pytest.fixture
def simulator(two_rooms: TriangleMesh) -> Simulator:
    return Simulator(two_rooms, 0.0, CAMERA)


@pytest.fixture(scope="module")
def floor() -> TraversableGrid:
    scene = make_scene("home:house:3")
    return TraversableGrid.from_mesh(scene.mesh, scene.floor_y_m)


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


def test_distance_hardly_depends_on_what_was_asked_before(simulator: Simulator) -> None:
    asked, fresh = (DistanceToPoint(simulator.grid, simulator.graph, (2.0, 1.5)) for _ in range(2))
    for x in np.linspace(-3.0, 1.0, 9):
        asked((x, -1.0 if x < -0.5 else 0.0))
    assert asked((-2.0, 1.5)) == pytest.approx(fresh((-2.0, 1.5)), abs=0.05)


def test_ways_are_walkable_and_hardly_longer_than_any_other(
    floor: TraversableGrid, rng: np.random.Generator
) -> None:
    """No shorter than the straight line, no longer than over the grid, and legs graze cells at most."""
    goal, *starts = (floor.sample_position(rng) for _ in range(30))
    distance = DistanceToPoint(floor, floor.graph, goal)
    for start in starts:
        path = distance.path_from(start)
        assert path is not None
        shares = np.linspace(0.0, 1.0, 400)[:, None, None]
        along = (path[:-1] + shares * (path[1:] - path[:-1])).reshape(-1, 2)
        assert np.mean([floor.is_navigable(place) for place in along]) > 0.99
        cell = floor.cell_at(start)
        assert cell is not None
        over_grid_m = distance.grid_distance_m[cell[0], cell[1]]
        length_m = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        assert length_m == pytest.approx(distance(start))
        assert np.linalg.norm(goal - start) - 1e-9 <= length_m <= over_grid_m + 0.1


def test_distance_shrinks_by_no_more_than_the_step(floor: TraversableGrid, rng: np.random.Generator) -> None:
    """Along its own way a robot comes nearer by what it walks, so that rewards add up."""
    goal, start = (floor.sample_position(rng) for _ in range(2))
    distance = DistanceToPoint(floor, floor.graph, goal)
    path = distance.path_from(start)
    assert path is not None
    legs_m = np.linalg.norm(np.diff(path, axis=0), axis=1)
    walked_m = np.arange(0.0, legs_m.sum(), 0.25)
    ends_m = np.concatenate([[0.0], np.cumsum(legs_m)])
    places = np.stack([np.interp(walked_m, ends_m, path[:, axis]) for axis in (0, 1)], axis=1)
    left_m = np.array([distance(place) for place in places])
    np.testing.assert_allclose(left_m, legs_m.sum() - walked_m, atol=0.1)


def test_limit_ends_at_its_distance_over_the_grid(simulator: Simulator) -> None:
    near, far = (-1.0, 0.0), (2.0, 1.5)
    distance = DistanceToPoint(simulator.grid, simulator.graph, (-2.0, 0.0), limit_m=2.0)
    assert distance(near) == distance_m(simulator, near, (-2.0, 0.0))
    assert distance(far) == float("inf")
