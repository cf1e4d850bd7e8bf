from dataclasses import replace

import numpy as np
import pytest

from anm_gym.geometry import CameraSpec
from anm_gym.metrics.completion import completion_samples
from anm_gym.metrics.oracle import GreedyCoverage
from anm_gym.metrics.view_table import build_view_table, candidate_positions
from anm_gym.sim.simulator import Simulator

CAMERA = CameraSpec(128, 128)


@pytest.fixture(scope="module")
def simulator(two_rooms):
    return Simulator(two_rooms, 0.0, CAMERA)


@pytest.fixture(scope="module")
def table(simulator):
    samples = completion_samples(simulator.mesh, 4000)
    positions = candidate_positions(simulator.grid, spacing_m=0.8)
    return build_view_table(samples, simulator.camera, simulator.mesh, 0.0, positions, 12)


@pytest.fixture
def planner(table, simulator):
    return GreedyCoverage(table, simulator.grid)


def look(planner, simulator, position_xz, heading_rad):
    simulator.place(position_xz, heading_rad)
    planner.mark_seen(simulator.depth_m(), CAMERA, simulator.world_from_camera)


def look_around(planner, simulator, position_xz):
    for heading in np.arange(36) * np.pi / 18:
        look(planner, simulator, position_xz, heading)


def test_with_nothing_seen_it_proposes_a_pose_that_covers_something(planner, simulator):
    goal = planner.next_goal([-2.0, 0.0], 0.0)
    assert simulator.grid.is_navigable(goal.position_xz)
    look(planner, simulator, goal.position_xz, goal.heading_rad)
    assert planner.covered_pct > 5.0
    assert goal.gain_samples > 100


def test_after_a_look_around_one_room_it_goes_to_the_other(planner, simulator):
    look_around(planner, simulator, [-2.0, 1.5])
    goal, before_pct = planner.next_goal([-2.0, 1.5], 0.0), planner.covered_pct
    assert 40.0 < before_pct < 80.0
    look(planner, simulator, goal.position_xz, goal.heading_rad)
    assert planner.covered_pct > before_pct + 5.0


def test_teleporting_from_goal_to_goal_covers_what_is_visible(planner, simulator):
    position, heading = np.array([-2.0, 0.0]), 0.0
    shares = []
    for _ in range(40):
        goal = planner.next_goal(position, heading)
        if goal is None:
            break
        position, heading = goal.position_xz, goal.heading_rad
        look(planner, simulator, position, heading)
        planner.give_up(goal)
        shares.append(planner.covered_pct)
    assert shares[-1] > 95.0
    assert (np.diff(shares) >= 0.0).all()


def test_it_ends_when_every_pose_was_tried(planner, table):
    position, heading, count = np.array([-2.0, 0.0]), 0.0, 0
    while (goal := planner.next_goal(position, heading)) is not None:
        planner.give_up(goal, radius_m=20.0)
        count += 1
    assert count == 1
    planner.reset()
    assert planner.next_goal(position, heading) is not None


def test_where_no_pose_covers_anything_there_is_no_goal(table, simulator):
    blind = replace(table, bits=np.zeros_like(table.bits))
    planner = GreedyCoverage(blind, simulator.grid)
    assert planner.next_goal([-2.0, 0.0], 0.0) is None
    assert planner.covered_pct == 100.0


def test_from_a_place_without_floor_there_is_no_goal(planner):
    assert planner.next_goal([50.0, 50.0], 0.0) is None


def test_the_cost_of_a_goal_counts_steps_and_turns(planner, simulator):
    goal = planner.next_goal([-2.0, 0.0], 0.0)
    distance_m = simulator.geodesic_distance_m([-2.0, 0.0], goal.position_xz)
    assert goal.cost_steps >= 0.9 * distance_m / 0.065
    assert goal.cost_steps <= 1.3 * distance_m / 0.065 + 3 * 36


def test_budget_of_no_step_is_refused(table, simulator):
    with pytest.raises(ValueError, match="`horizon_steps` must be >= 1, got 0"):
        GreedyCoverage(table, simulator.grid, horizon_steps=0)
