"""Attribution: walks whose failure is known, and only that failure."""

from dataclasses import replace

import numpy as np
import pytest

from train.attribution import (
    AttributionSettings,
    attribute,
    goal_fates,
    module_shares_pct,
    oscillating_steps,
    stuck_steps,
)
from train.trajectory import Trajectory

STEP_M = 0.065
FORWARD, LEFT = 1, 2
SURFACE_M2 = 500.0
SETTINGS = AttributionSettings()


def walk(x_m, completion=None, contacts=(), actions=None, goals=(), failures=(), reasons=()):
    """Make an episode along x, with contacts at the given steps."""
    x_m = np.asarray(x_m, float)
    steps = len(x_m) - 1
    poses = np.column_stack([x_m, np.zeros(steps + 1), np.zeros(steps + 1)])
    collisions = np.zeros(steps + 1)
    for step in contacts:
        collisions[step + 1 :] += 1
    gained = np.linspace(0.0, 80.0, steps + 1) if completion is None else np.asarray(completion, float)
    return Trajectory(
        "room",
        0,
        np.full(steps, FORWARD, np.int8) if actions is None else np.asarray(actions, np.int8),
        poses,
        goals=np.array(goals, float).reshape(-1, 3),
        curves={"comp_pct": gained, "collisions": collisions},
        goal_reasons=reasons or ("frontier",) * len(goals),
        failures=np.array(failures, float).reshape(-1, 3),
        failure_reasons=("no way",) * len(failures),
        surface_m2=SURFACE_M2,
    )


def straight(steps):
    return STEP_M * np.arange(steps + 1)


def test_straight_walk_fails_at_nothing():
    found = attribute(walk(straight(60), goals=[(60 * STEP_M, 0.0, 0)]), 0.2)
    assert found.shares_pct == dict.fromkeys(found.shares_pct, 0.0)
    assert found.main_cause == "none"
    assert found.rotation_pct == 0.0


def test_agent_that_keeps_running_into_a_wall_is_stuck_there():
    x_m = np.concatenate([straight(30), np.full(30, 30 * STEP_M)])
    found = attribute(walk(x_m, contacts=range(30, 60)), None)
    np.testing.assert_array_equal(np.flatnonzero(found.is_stuck), np.arange(28, 60))
    assert found.main_cause == "stuck"
    assert found.shares_pct["stuck_pct"] == pytest.approx(100.0 * 32 / 60)


def test_agent_that_looks_around_is_not_stuck():
    turning = walk(np.zeros(41), actions=[LEFT] * 40)
    assert not stuck_steps(turning, SETTINGS).any()
    assert attribute(turning, None).rotation_pct == 100.0


def test_walk_along_a_wall_is_not_stuck():
    assert not stuck_steps(walk(straight(60), contacts=range(0, 60, 2)), SETTINGS).any()


def test_two_contacts_in_a_stretch_do_not_make_an_agent_stuck():
    assert not stuck_steps(walk(np.zeros(21), contacts=(3, 9)), SETTINGS).any()
    assert stuck_steps(walk(np.zeros(21), contacts=(3, 9, 15)), SETTINGS).all()


def test_short_episode_is_not_stuck():
    assert not stuck_steps(walk(np.zeros(10), contacts=range(9)), SETTINGS).any()


def there_and_back(length):
    return np.concatenate([straight(length), straight(length)[-2::-1]])


def test_way_there_and_back_for_nothing_is_an_oscillation():
    x_m = np.concatenate([there_and_back(20), there_and_back(20)[1:]])
    found = attribute(walk(x_m, completion=np.full(81, 40.0)), None)
    assert found.shares_pct["oscillation_pct"] == 100.0
    assert found.main_cause == "oscillation"


def test_way_back_from_something_new_is_none():
    assert not oscillating_steps(walk(there_and_back(20)), SETTINGS).any()


def test_only_the_far_end_of_a_long_way_is_a_loop():
    """A hundred steps there and back, and the quarter of a metre within which one is back."""
    found = oscillating_steps(walk(there_and_back(60), completion=np.full(121, 40.0)), SETTINGS)
    np.testing.assert_array_equal(np.flatnonzero(found), np.arange(9, 111))


def turning(headings_deg, completion):
    poses = np.column_stack([np.zeros((len(headings_deg), 2)), np.deg2rad(headings_deg)])
    curves = {"comp_pct": np.asarray(completion, float), "collisions": np.zeros(len(poses))}
    return Trajectory(
        "room", 0, np.full(len(poses) - 1, LEFT, np.int8), poses, curves=curves, surface_m2=SURFACE_M2
    )


def test_turning_to_and_fro_for_nothing_is_an_oscillation():
    to_and_fro = [170, 180, -170, -160, -150, -140, -150, -160, -170, 180, 170]
    assert oscillating_steps(turning(to_and_fro, np.full(11, 5.0)), SETTINGS).all()
    assert not oscillating_steps(turning(to_and_fro, np.arange(11.0)), SETTINGS).any()
    assert not oscillating_steps(turning([0, 10, 20, 10, 0], np.full(5, 5.0)), SETTINGS).any()


def test_second_look_around_for_nothing_is_an_oscillation():
    twice = np.arange(0, 730, 10)
    found = oscillating_steps(turning(twice, np.minimum(twice, 360.0)), SETTINGS)
    np.testing.assert_array_equal(np.flatnonzero(found), np.arange(36, 72))


def test_steps_on_goals_that_were_given_up_are_counted():
    goals = [(9.0, 9.0, 0), (1.0, 0.0, 15), (9.0, 8.0, 20)]
    failures = [(9.0, 9.0, 15), (9.0, 8.0, 40)]
    found = attribute(walk(straight(40), goals=goals, failures=failures), 0.2)
    np.testing.assert_array_equal(found.fates.is_failed, [True, False, True])
    assert found.shares_pct["unreachable_pct"] == pytest.approx(100.0 * 35 / 40)
    assert found.failure_reasons == {"no way": 2}
    assert found.main_cause == "unreachable goals"


def test_goal_that_is_proposed_again_later_has_not_failed_then():
    goals = [(9.0, 9.0, 0), (5.0, 0.0, 10), (9.0, 9.0, 20)]
    fates = goal_fates(walk(straight(40), goals=goals, failures=[(9.0, 9.0, 10)]), 0.2, SETTINGS)
    np.testing.assert_array_equal(fates.is_failed, [True, False, False])


def test_reached_goal_that_showed_nothing_was_phantom():
    goals = [(20 * STEP_M, 0.0, 0), (40 * STEP_M, 0.0, 20)]
    completion = np.concatenate([np.linspace(0.0, 50.0, 21), np.full(20, 50.0)])
    found = attribute(walk(straight(40), completion, goals=goals), 0.2)
    np.testing.assert_array_equal(found.fates.is_reached, [True, True])
    np.testing.assert_array_equal(found.fates.is_fruitless, [False, True])
    assert found.shares_pct["phantom_pct"] == 50.0
    assert found.main_cause == "phantom surface"


def test_what_is_new_is_measured_in_square_metres():
    """A room's worth of surface is a small share of an office's, and no phantom there."""
    goals = [(20 * STEP_M, 0.0, 0)]
    for gain_pct, surface_m2, is_fruitless in ((0.05, 16_000.0, False), (0.3, 100.0, True)):
        seen = np.linspace(10.0, 10.0 + gain_pct, 21)
        office = replace(walk(straight(20), seen, goals=goals), surface_m2=surface_m2)
        assert goal_fates(office, 0.2, SETTINGS).is_fruitless.tolist() == [is_fruitless]


def test_goal_counts_as_reached_within_the_slack_of_its_arrival():
    end_m = 20 * STEP_M
    for left_m, is_reached in ((0.19, True), (0.29, True), (0.31, False)):
        fates = goal_fates(walk(straight(20), goals=[(end_m + left_m, 0.0, 0)]), 0.2, SETTINGS)
        assert fates.is_reached.tolist() == [is_reached]


def test_goal_that_promised_nothing_is_no_phantom():
    goals = [(20 * STEP_M, 0.0, 0)]
    fates = goal_fates(walk(straight(20), np.full(21, 9.0), goals=goals, reasons=("wander",)), 0.2, SETTINGS)
    assert fates.is_reached.all()
    assert not fates.is_fruitless.any()


def test_steps_after_the_last_progress_are_counted():
    completion = np.concatenate([np.linspace(0.0, 50.0, 21), np.full(20, 50.2)])
    assert attribute(walk(straight(40), completion), None).no_gain_pct == pytest.approx(52.5)


def test_row_of_an_agent_without_goals_has_nulls():
    row = attribute(walk(straight(10)), None).as_row()
    assert row["unreachable_pct"] is row["phantom_pct"] is row["goals"] is row["goals_failed"] is None
    assert row["stuck_pct"] == 0.0


def test_files_of_earlier_versions_can_be_attributed():
    trajectory = walk(straight(30), goals=[(30 * STEP_M, 0.0, 0)])
    old = Trajectory("room", 0, trajectory.actions, trajectory.poses, {}, trajectory.goals, trajectory.curves)
    found = attribute(old, 0.2)
    assert found.fates.is_reached.all()
    assert set(found.shares_pct.values()) == {0.0}, "of surface that is not known none is missed"


def test_episode_that_stopped_at_once_has_no_share():
    found = attribute(walk([0.0], goals=[(1.0, 1.0, 0)]), 0.2)
    assert found.main_cause == "none"
    assert set(found.shares_pct.values()) == {0.0}


def test_cpu_time_is_shared_out_among_the_modules():
    assert module_shares_pct({"goal": 2.0, "other": 6.0, "total": 8.0}) == {"goal": 25.0, "other": 75.0}
    assert module_shares_pct({}) == {}


def test_one_failure_is_that_of_the_last_goal_at_its_place():
    x_m = straight(20)
    goals = [(x_m[20], 0.0, 0), (x_m[20], 0.0, 20), (5.0, 0.0, 20)]
    fates = goal_fates(walk(x_m, goals=goals, failures=[(x_m[20], 0.0, 20)]), 0.2, SETTINGS)
    assert fates.is_failed.tolist() == [False, True, False]
    assert fates.is_reached.tolist() == [True, False, False]


@pytest.mark.parametrize("reason", ["wander", "look round", "random vertex", "on the way"])
def test_goal_that_promises_no_surface_breaks_no_promise(reason):
    seen = np.zeros(21)
    found = attribute(walk(straight(20), seen, goals=[(20 * STEP_M, 0.0, 0)], reasons=(reason,)), 0.2)
    assert found.shares_pct["phantom_pct"] == 0.0
