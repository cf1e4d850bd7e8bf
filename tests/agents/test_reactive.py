from collections.abc import Callable

import numpy as np
import pytest

from agents.batching import actions_for
from agents.reactive import BumpAndTurnPolicy, RandomPolicy, SpinAndWalkPolicy
from anm_gym.actions import MOVES, Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.mesh import TriangleMesh

SINGLE = {"compass": np.zeros(1, np.float32), "gps": np.zeros(2, np.float32)}


def walk_to(policy: BumpAndTurnPolicy | SpinAndWalkPolicy, gps: tuple[float, float]) -> Action:
    action, _ = policy.predict({**SINGLE, "gps": np.array(gps, np.float32)})
    return Action(int(action))


def test_random_draws_the_three_moves_alike() -> None:
    policy = RandomPolicy(seed=1)
    drawn = [int(policy.predict(SINGLE)[0]) for _ in range(3000)]
    counts = np.bincount(drawn, minlength=4)
    assert counts[Action.STOP] == 0
    assert (np.abs(counts[list(MOVES)] - 1000) < 100).all()


def test_random_draws_anew_with_each_episode() -> None:
    policy = RandomPolicy(seed=2)
    first, second = (
        [int(policy.predict(SINGLE, episode_start=np.array([step == 0]))[0]) for step in range(20)]
        for _ in range(2)
    )
    assert first == second


def test_draws_are_not_those_of_an_environment_with_the_same_seed() -> None:
    """Both are seeded alike by whoever plays episodes; the start must not tell the first move."""
    moves = [MOVES.index(int(RandomPolicy(seed).predict(SINGLE)[0])) for seed in range(300)]
    of_environment = [int(np.random.default_rng(seed).integers(3)) for seed in range(300)]
    assert 0.25 < np.mean(np.equal(moves, of_environment)) < 0.42


def test_agent_walks_until_a_step_is_blocked_then_turns_one_way() -> None:
    policy = BumpAndTurnPolicy(seed=0)
    assert walk_to(policy, (0.0, 0.0)) is Action.MOVE_FORWARD
    assert walk_to(policy, (0.06, 0.0)) is Action.MOVE_FORWARD
    turns = [walk_to(policy, (0.06, 0.0)) for _ in range(19)]
    until = turns.index(Action.MOVE_FORWARD)
    assert 3 <= until <= 18
    assert len(set(turns[:until])) == 1


def test_bump_and_turn_gets_about_in_a_room(
    explore: Callable[..., ExploreEnv], box_room: Callable[..., TriangleMesh]
) -> None:
    env, policy = explore(box_room(), start=(0.0, 0.0, 0.0)), BumpAndTurnPolicy(seed=0)
    observation, info = env.reset(seed=0)
    for step in range(300):
        action, _ = policy.predict(observation, None, np.array([step == 0]))
        observation, _, _, _, info = env.step(np.int64(action))
    assert info["path_length_m"] > 8.0
    assert info["collisions"] < 20


def test_steps_of_a_centimetre_and_a_half_are_not_blocked() -> None:
    for policy in (BumpAndTurnPolicy(0, 0.015), SpinAndWalkPolicy(0, 0.015)):
        while walk_to(policy, (0.0, 0.0)) is not Action.MOVE_FORWARD:
            pass
        assert walk_to(policy, (0.015, 0.0)) is Action.MOVE_FORWARD
        assert walk_to(policy, (0.02, 0.0)) is not Action.MOVE_FORWARD


def test_action_has_the_shape_of_the_observation() -> None:
    assert actions_for(SINGLE, Action.TURN_LEFT).shape == ()
    assert actions_for({"compass": np.zeros((1, 1))}, Action.TURN_LEFT).tolist() == [2]


def test_one_agent_is_for_one_environment() -> None:
    with pytest.raises(ValueError, match="must be of one environment, got 2"):
        actions_for({"compass": np.zeros((2, 1))}, Action.TURN_LEFT)


def test_forward_preset_mostly_walks_and_turns_both_ways_alike() -> None:
    policy = RandomPolicy(seed=1, preset="forward")
    counts = np.bincount([int(policy.predict(SINGLE)[0]) for _ in range(3000)], minlength=4)
    assert counts[Action.STOP] == 0
    assert abs(counts[Action.MOVE_FORWARD] - 2400) < 100
    assert abs(counts[Action.TURN_LEFT] - counts[Action.TURN_RIGHT]) < 80


def test_unknown_random_preset_lists_the_choices() -> None:
    with pytest.raises(ValueError, match="unknown random preset 'lazy'; choose one of: uniform, forward"):
        RandomPolicy(preset="lazy")


def test_spin_looks_all_round_before_it_walks_and_after_a_bump() -> None:
    policy = SpinAndWalkPolicy(seed=0)

    def act(gps: float) -> Action:
        return Action(int(policy.predict({**SINGLE, "gps": np.array([gps, 0.0], np.float32)})[0]))

    first = [act(0.0) for _ in range(100)]
    turns = first.index(Action.MOVE_FORWARD)
    assert set(first[:turns]) == {Action.TURN_LEFT}
    assert 36 <= turns < 72
    assert act(0.0) is Action.TURN_LEFT


def test_angles_and_lengths_are_those_of_the_agent_s_steps() -> None:
    """Turns of 30 degrees and steps of 25 cm: a look round is 12 to 23 turns, a walk 1 to 16 steps."""
    spin, runs = SpinAndWalkPolicy(0, 0.25, 30.0), [[0, 0]]
    for step in range(600):
        action = Action(spin.predict({**SINGLE, "gps": np.array([0.25 * step, 0.0])})[0])
        if action is Action.TURN_LEFT and runs[-1][1]:
            runs.append([0, 0])
        runs[-1][action is Action.MOVE_FORWARD] += 1
    turns, walks = np.array(runs[:-1]).T
    assert 12 <= turns.min() <= turns.max() <= 23
    assert 1 <= walks.min() <= walks.max() <= 16
    for seed in range(20):
        bump = BumpAndTurnPolicy(seed, turn_step_deg=30.0)
        moves = [walk_to(bump, (0.0, 0.0)) for _ in range(8)]
        assert 1 <= sum(move is not Action.MOVE_FORWARD for move in moves) <= 6


def test_spin_gets_about_in_a_room(
    explore: Callable[..., ExploreEnv], box_room: Callable[..., TriangleMesh]
) -> None:
    env, policy = explore(box_room(), start=(0.0, 0.0, 0.0)), SpinAndWalkPolicy(seed=0)
    observation, info = env.reset(seed=0)
    for step in range(400):
        action, _ = policy.predict(observation, None, np.array([step == 0]))
        observation, _, _, _, info = env.step(np.int64(action))
    assert info["path_length_m"] > 3.0
