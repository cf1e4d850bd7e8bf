"""What a navigator need not try, and when it may again."""

import numpy as np

from agents.patience import PATIENCE_M
from agents.reflexes import AWAY_M, LINGER_STEPS, MAX_LED_STEPS, Reflexes
from anm_gym.actions import Action
from anm_gym.geometry import camera_pose

FORWARD, STOP = int(Action.MOVE_FORWARD), int(Action.STOP)
FAR, NEAR, THERE = np.array([3.0]), np.array([0.19]), np.array([0.14])
STEP_M = 0.25
MAX_TURNS = 24
"""Turns of ten degrees that lead two thirds of the way round."""


def pose(x: float, z: float, heading_rad: float) -> np.ndarray:
    return camera_pose((x, 1.0, z), heading_rad)[None].astype(np.float32)


def test_stop_is_worth_a_try_only_where_it_succeeds_and_has_no_choice_where_the_agent_has_arrived() -> None:
    """Steps of 6.5 cm lead nearer, so such an agent does not stop where the way may still be too long."""
    distances_m = np.array([0.21, 0.19, 0.14])
    poses, moves = pose(0, 0, 0).repeat(3, axis=0), [FORWARD, 2, 3]
    for step_m, may_stop in ((0.25, [False, True, True]), (0.065, [False, False, True])):
        allowed = Reflexes(3, step_m).allowed(poses, distances_m)
        assert allowed[:, STOP].tolist() == may_stop
        assert allowed[:, moves].all(axis=1).tolist() == [True, True, False]
        assert not allowed[2, moves].any()


def test_agents_of_different_steps_stop_at_different_distances() -> None:
    reflexes, poses = Reflexes(2, np.array([0.25, 0.065])), pose(0, 0, 0).repeat(2, axis=0)
    assert reflexes.allowed(poses, NEAR.repeat(2))[:, STOP].tolist() == [True, False]
    reflexes.keep([1, 0])
    assert reflexes.allowed(poses, NEAR.repeat(2))[:, STOP].tolist() == [False, True]


def test_agent_that_lingers_where_a_stop_succeeds_is_as_near_as_it_gets() -> None:
    """Not in a row: in a pocket it goes to and fro. A new goal starts the count anew."""
    reflexes, here, moves = Reflexes(1, 0.065), pose(0, 0, 0), [FORWARD, 2, 3]
    for count in range(2 * LINGER_STEPS):
        distance_m = NEAR if count % 2 == 0 else FAR
        reflexes.update(pose(0.1 * count, 0, 0), distance_m, np.array([FORWARD]))
        if distance_m is NEAR:
            allowed = reflexes.allowed(here, NEAR)[0]
            is_enough = count // 2 + 1 >= LINGER_STEPS
            assert (bool(allowed[STOP]), bool(allowed[moves].any())) == (is_enough, not is_enough)
    reflexes.begin_goal(0)
    assert not reflexes.allowed(here, NEAR)[0, STOP]


def test_heading_that_was_blocked_is_not_tried_again_before_the_agent_has_moved() -> None:
    reflexes = Reflexes(1, STEP_M)
    steps = [(0.0, 0.0, Action.STOP), (0.0, 0.0, Action.MOVE_FORWARD), (0.0, 0.5, Action.TURN_LEFT)]
    allowed = []
    for x, heading_rad, previous in [*steps, (0.0, 0.0, Action.TURN_RIGHT), (0.1, 0.0, Action.MOVE_FORWARD)]:
        here = pose(x, 0.0, heading_rad)
        reflexes.update(here, FAR, np.array([int(previous)]))
        allowed.append(bool(reflexes.allowed(here, FAR)[0, FORWARD]))
    assert allowed == [True, False, True, False, True]


def test_heading_is_known_again_across_the_half_turn() -> None:
    reflexes = Reflexes(1, STEP_M)
    for heading_rad in (np.pi - 0.01, np.pi - 0.01):
        reflexes.update(pose(0, 0, heading_rad), FAR, np.array([FORWARD]))
    assert not reflexes.allowed(pose(0, 0, -np.pi + 0.01), NEAR)[0, FORWARD]


def test_steps_of_a_centimetre_and_a_half_are_moves() -> None:
    reflexes = Reflexes(2, np.array([STEP_M, 0.015]))
    for count in range(2):
        here = pose(0.012 * count, 0, 0).repeat(2, axis=0)
        reflexes.update(here, FAR.repeat(2), np.array([FORWARD] * 2))
    assert reflexes.allowed(here, FAR.repeat(2))[:, FORWARD].tolist() == [False, True]
    reflexes.keep([1, 0])
    reflexes.update(here, FAR.repeat(2), np.array([FORWARD] * 2))
    assert not reflexes.allowed(here, FAR.repeat(2))[:, FORWARD].any()


def test_agent_is_lost_after_two_thirds_of_the_way_round_however_small_its_turns() -> None:
    for turn_step_deg, turns in ((5.0, 48), (10.0, 24), (30.0, 8)):
        reflexes, counts = Reflexes(1, STEP_M, turn_step_rad=np.deg2rad(turn_step_deg)), []
        for count in range(1, 60):
            reflexes.update(pose(0, 0, 0), FAR, np.array([int(Action.TURN_LEFT)]))
            counts += [count] if reflexes.lost[0] else []
        assert counts[0] == turns + 1  # the first call tells where it is


def test_new_episode_forgets() -> None:
    reflexes = Reflexes(1, STEP_M)
    for _ in range(2):
        reflexes.update(pose(0, 0, 0), FAR, np.array([FORWARD]))
    assert not reflexes.allowed(pose(0, 0, 0), FAR)[0, FORWARD]
    reflexes.begin(0)
    assert reflexes.allowed(pose(0, 0, 0), FAR)[0, FORWARD]


def test_agent_that_turns_to_and_fro_on_one_spot_may_not_turn_back_until_it_leaves() -> None:
    reflexes, left, right = Reflexes(2, STEP_M), int(Action.TURN_LEFT), int(Action.TURN_RIGHT)

    def step(x: float, actions: list[int]) -> list[list[int]]:
        poses = np.concatenate([pose(x, 0, 0), pose(9.0, 0, 0)])
        reflexes.update(poses, FAR.repeat(2), np.array(actions))
        allowed = reflexes.allowed(poses, FAR.repeat(2))
        return [np.flatnonzero(row[[left, right]]).tolist() for row in allowed]

    step(0.0, [STOP, STOP])
    for count in range(MAX_TURNS):
        turns = step(0.01 * count, [right if count % 2 else left, FORWARD])
        assert turns == ([[0, 1], [0, 1]] if count < MAX_TURNS - 1 else [[1], [0, 1]])
    assert step(0.3, [FORWARD, FORWARD])[0] == [1]
    assert step(0.3, [left, FORWARD])[0] == [0]
    assert step(0.8, [FORWARD, FORWARD])[0] == [0]
    assert step(AWAY_M + 0.1, [FORWARD, FORWARD])[0] == [0, 1]


def lost_agent(turn_step_deg: float = 10.0) -> Reflexes:
    """An agent that has turned on the spot at the origin for too long."""
    reflexes = Reflexes(1, STEP_M, turn_step_rad=np.deg2rad(turn_step_deg))
    for _ in range(MAX_TURNS + 1):
        reflexes.update(pose(0, 0, 0), FAR, np.array([int(Action.TURN_LEFT)]))
    assert reflexes.lost.tolist() == [True]
    return reflexes


def lead(reflexes: Reflexes, goal_to_the_left_deg: float, distance: np.ndarray = FAR) -> list[int]:
    """Allowed actions of an agent with heading 0 if the goal comes nearer in one direction."""
    lefts = np.arange(0.0, 360.0, 10.0)
    away = np.abs((lefts - goal_to_the_left_deg + 180.0) % 360.0 - 180.0).astype(np.float32)
    return np.flatnonzero(reflexes.allowed(pose(0, 0, 0), distance, {0: away})[0]).tolist()


def test_lost_agent_is_led_to_where_the_goal_comes_nearest_the_short_way_round() -> None:
    left, right = int(Action.TURN_LEFT), int(Action.TURN_RIGHT)
    for direction, action in ((0.0, FORWARD), (10.0, left), (170.0, left), (190.0, right), (350.0, right)):
        assert lead(lost_agent(), direction) == [action], direction


def test_lost_agent_is_not_led_into_what_stopped_it() -> None:
    reflexes = lost_agent()
    reflexes.update(pose(0, 0, 0), FAR, np.array([FORWARD]))
    assert lead(reflexes, 1.0) == [int(Action.TURN_LEFT)]
    assert lead(reflexes, 359.0) == [int(Action.TURN_RIGHT)]


def test_agent_with_wide_turns_walks_where_no_turn_brings_it_nearer() -> None:
    assert lead(lost_agent(30.0), 10.0) == [FORWARD]
    assert lead(lost_agent(30.0), 20.0) == [int(Action.TURN_LEFT)]


def test_lost_agent_stops_where_it_may() -> None:
    assert lead(lost_agent(), 90.0, NEAR) == [STOP]
    assert lead(lost_agent(), 90.0, THERE) == [STOP]


def test_agent_that_comes_no_nearer_for_long_is_led_until_it_has_another_goal() -> None:
    reflexes = Reflexes(1, STEP_M)
    for count in range(int(PATIENCE_M / STEP_M) + 1):
        assert not reflexes.lost[0]
        reflexes.update(pose(count, 0, 0), FAR, np.array([FORWARD]))
    assert reflexes.lost[0]
    assert lead(reflexes, 90.0) == [int(Action.TURN_LEFT)]
    reflexes.begin_goal(0)
    assert not reflexes.lost[0]


def test_lost_agent_is_led_for_a_while_only() -> None:
    reflexes = lost_agent()
    for _ in range(MAX_LED_STEPS):
        reflexes.update(pose(0, 0, 0), FAR, np.array([FORWARD]))
        assert reflexes.lost[0]
    reflexes.update(pose(0, 0, 0), FAR, np.array([FORWARD]))
    assert not reflexes.lost[0]


def test_new_goal_may_be_turned_to_either_way() -> None:
    reflexes = Reflexes(1, STEP_M)
    for _ in range(MAX_TURNS + 1):
        reflexes.update(pose(0, 0, 0), FAR, np.array([int(Action.TURN_LEFT)]))
    assert not reflexes.allowed(pose(0, 0, 0), FAR)[0, int(Action.TURN_RIGHT)]
    reflexes.begin_goal(0)
    assert reflexes.allowed(pose(0, 0, 0), FAR)[0].tolist() == [False, True, True, True]


def test_agents_that_are_kept_remember_what_they_did_themselves() -> None:
    """The first has walked into something, the second wanders, the third has turned for long."""
    reflexes, left = Reflexes(3, STEP_M), int(Action.TURN_LEFT)
    for count in range(MAX_TURNS + 1):
        poses = np.concatenate([pose(0, 0, 0), pose(count, 0, 0), pose(9, 0, 0)])
        reflexes.update(poses, FAR.repeat(3), np.array([FORWARD, FORWARD, left]))
    everyone = reflexes.allowed(poses, FAR.repeat(3))
    assert len(np.unique(everyone, axis=0)) == 3
    kept = [2, 0]
    reflexes.keep(kept)
    np.testing.assert_array_equal(reflexes.allowed(poses[kept], FAR.repeat(2)), everyone[kept])
