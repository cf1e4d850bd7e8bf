"""The teacher walks nearly the shortest way, collides never and does not flicker."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from agents.teacher import GeodesicTeacher
from anm_gym.actions import Action
from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.point_distance import DistanceToPoint
from anm_gym.sim.simulator import Simulator
from anm_gym.sim.traversable import BodySpec

CAMERA = CameraSpec(width_px=4, height_px=4)
TURN_RAD = np.deg2rad(10.0)


def walk(
    mesh: TriangleMesh, start: tuple[float, float, float], goal: tuple[float, float], step_m: float
) -> tuple[list[Action], float, int, float]:
    """Let the teacher walk; returns its actions, the way, the collisions and the shortest way."""
    simulator = Simulator(mesh, 0.0, CAMERA, forward_step_m=step_m)
    simulator.place(start[:2], start[2])
    teacher = GeodesicTeacher(simulator.grid, goal, step_m, TURN_RAD)
    actions, way_m, collisions = [], 0.0, 0
    while not actions or (actions[-1] is not Action.STOP and len(actions) < 400):
        actions.append(teacher(simulator.state.position_xz, simulator.state.heading_rad))
        motion = simulator.act(actions[-1])
        way_m, collisions = way_m + motion.travelled_m, collisions + motion.collided
    assert np.linalg.norm(simulator.state.position_xz - goal) < 0.2
    return actions, way_m, collisions, DistanceToPoint(simulator.grid, simulator.graph, goal)(start[:2])


@pytest.mark.parametrize("step_m", [0.065, 0.13, 0.25])
@pytest.mark.parametrize("heading_rad", [0.0, 1.9, -2.7])
def test_next_room_is_reached_by_nearly_the_shortest_way(
    two_rooms: TriangleMesh, step_m: float, heading_rad: float
) -> None:
    actions, way_m, collisions, shortest_m = walk(two_rooms, (-3.0, -1.0, heading_rad), (3.0, 1.2), step_m)
    assert actions[-1] is Action.STOP
    assert way_m < 1.1 * shortest_m
    assert collisions == 0


def test_left_never_follows_right(two_rooms: TriangleMesh) -> None:
    turns = {Action.TURN_LEFT, Action.TURN_RIGHT}
    for heading_rad in np.linspace(-np.pi, np.pi, 9):
        actions, *_ = walk(two_rooms, (-3.0, 1.3, float(heading_rad)), (2.5, -1.4), 0.1)
        assert all({first, second} != turns for first, second in pairwise(actions))


def test_goal_behind_is_turned_to_before_walking(box_room: Callable[..., TriangleMesh]) -> None:
    actions, *_ = walk(box_room(), (0.0, 1.0, np.pi), (0.0, -1.0), 0.065)
    assert len(set(actions[:17])) == 1
    assert actions[0] in {Action.TURN_LEFT, Action.TURN_RIGHT}
    assert actions[19:-1].count(Action.MOVE_FORWARD) >= len(actions[19:-1]) - 2


def test_agent_at_the_goal_stops(box_room: Callable[..., TriangleMesh]) -> None:
    grid = Simulator(box_room(), 0.0, CAMERA).grid
    teacher = GeodesicTeacher(grid, (0.5, 0.5), 0.065, TURN_RAD)
    assert teacher(np.array([0.55, 0.5]), 0.0) is Action.STOP
    assert teacher(np.array([0.9, 0.5]), 0.0) is not Action.STOP


@pytest.mark.parametrize("radius_m", [0.1, 0.3, 0.45])
def test_tight_floor_is_dear_for_bodies_of_any_width(
    box_room: Callable[..., TriangleMesh], radius_m: float
) -> None:
    """The way keeps away from a wall that the straight line would graze."""
    simulator = Simulator(box_room(6.0, 6.0), 0.0, CAMERA, body=BodySpec(radius_m=radius_m))
    beside_m = -3.0 + radius_m + 0.06
    teacher = GeodesicTeacher(simulator.grid, (beside_m, 2.0), 0.065, TURN_RAD)
    simulator.place((beside_m, -2.0), np.pi)
    nearest_m = np.inf
    for step in range(300):
        action = teacher(simulator.state.position_xz, simulator.state.heading_rad)
        if action is Action.STOP:
            break
        simulator.act(action)
        if step > 20 and abs(simulator.state.position_xz[1]) < 1.0:
            nearest_m = min(nearest_m, float(simulator.state.position_xz[0]) + 3.0)
    assert action is Action.STOP
    assert nearest_m > radius_m + 0.07
