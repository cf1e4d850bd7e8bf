"""Exploration: what it pays and when it ends."""

from collections.abc import Callable

import numpy as np
import pytest

from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv


def test_rewards_add_up_to_the_explored_area(explore: Callable[..., ExploreEnv]) -> None:
    env = explore(start=(0.0, 0.0, 0.0))
    _, first = env.reset(seed=0)
    rewards, last = [], first
    for _ in range(36):
        _, reward, _, _, last = env.step(Action.TURN_LEFT)
        rewards.append(reward)
    assert min(rewards) >= 0.0
    assert sum(rewards) == pytest.approx(last["explored_m2"] - first["explored_m2"])
    assert last["explored_m2"] < env.simulator.grid.navigable_area_m2


def test_reward_can_be_left_out(explore: Callable[..., ExploreEnv]) -> None:
    env = explore(reward="none")
    _, info = env.reset(seed=0)
    assert "explored_m2" not in info
    assert [env.step(Action.TURN_LEFT)[1] for _ in range(5)] == [0.0] * 5


def test_reward_does_not_depend_on_the_noise_of_depth(explore: Callable[..., ExploreEnv]) -> None:
    turns = []
    for noise in (None, {"depth_std_fraction": 0.2}):
        env = explore(start=(0.0, 0.0, 0.0), noise=noise)
        env.reset(seed=0)
        turns.append([env.step(Action.TURN_LEFT)[1] for _ in range(9)])
    assert turns[0] == turns[1]


def test_unknown_reward_is_refused() -> None:
    with pytest.raises(ValueError, match="`reward` must be one of area, none, got 'volume'"):
        ExploreEnv(reward="volume")


@pytest.mark.parametrize("action", Action)
def test_only_stop_ends_an_episode(explore: Callable[..., ExploreEnv], action: Action) -> None:
    env = explore()
    env.reset(seed=0)
    _, _, terminated, truncated, _ = env.step(action)
    assert terminated is (action is Action.STOP)
    assert truncated is False


def test_walking_into_a_wall_collides_and_stays_inside(explore: Callable[..., ExploreEnv]) -> None:
    env = explore(start=(0.0, -1.8, 0.0))
    env.reset(seed=0)
    infos = [env.step(Action.MOVE_FORWARD)[4] for _ in range(4)]
    assert [info["collided"] for info in infos] == [False, True, True, True]
    assert infos[-1]["collisions"] == 3
    assert infos[-1]["path_length_m"] == pytest.approx(2.0 - 1.8 - 0.1, abs=0.03)
    assert env.simulator.grid.is_navigable(env.simulator.state.position_xz)


def test_gps_and_compass_tell_the_way_from_the_start(explore: Callable[..., ExploreEnv]) -> None:
    env = explore(start=(0.0, 0.0, 1.0), turn_step_deg=90.0, forward_step_m=0.5)
    observation, _ = env.reset(seed=0)
    np.testing.assert_array_equal(observation["gps"], [0.0, 0.0])
    np.testing.assert_array_equal(observation["compass"], [0.0])
    for action in (Action.MOVE_FORWARD, Action.MOVE_FORWARD, Action.TURN_RIGHT, Action.MOVE_FORWARD):
        observation, *_ = env.step(action)
    np.testing.assert_allclose(observation["gps"], [1.0, 0.5], atol=1e-6)
    np.testing.assert_allclose(observation["compass"], [-np.pi / 2], atol=1e-6)


def test_depth_of_a_wall_ahead_is_its_distance(explore: Callable[..., ExploreEnv]) -> None:
    env = explore(start=(0.0, 0.5, 0.0))
    observation, _ = env.reset(seed=0)
    np.testing.assert_allclose(observation["depth"][8, 10:14], 2.5, atol=1e-5)
    np.testing.assert_allclose(observation["world_from_camera"][:3, 3], [0.0, 1.25, 0.5], atol=1e-6)
