"""Point goals: rewards, success and efficiency against hand-made episodes."""

from collections.abc import Callable

import numpy as np
import pytest

from anm_gym.actions import Action
from anm_gym.envs.pointnav import PointNavEnv
from anm_gym.errors import EpisodeError

STRAIGHT = {"start": (1.0, 0.0, -np.pi / 2), "goal": (2.0, 0.0)}


def test_straight_walk_to_the_goal_is_a_perfect_episode(pointnav: Callable[..., PointNavEnv]) -> None:
    env = pointnav(forward_step_m=0.25)
    observation, info = env.reset(seed=0, options=STRAIGHT)
    np.testing.assert_allclose(observation["pointgoal_with_gps_compass"], [1.0, 0.0], atol=1e-6)
    assert info["distance_to_goal_m"] == pytest.approx(1.0)
    rewards = [env.step(Action.MOVE_FORWARD)[1] for _ in range(4)]
    np.testing.assert_allclose(rewards, 0.25 - 0.01, atol=1e-9)
    _, reward, terminated, _, info = env.step(Action.STOP)
    assert terminated
    assert reward == pytest.approx(2.5 - 0.01)
    assert info["is_success"] is True
    assert info["spl"] == pytest.approx(1.0)
    assert info["soft_spl"] == pytest.approx(1.0)


def test_detour_costs_efficiency(pointnav: Callable[..., PointNavEnv]) -> None:
    env = pointnav(forward_step_m=0.5, turn_step_deg=90.0)
    env.reset(seed=0, options=STRAIGHT)
    for action in (1, 1, 1, 2, 2, 1, 0):
        *_, info = env.step(action)
    assert info["path_length_m"] == pytest.approx(2.0)
    assert info["spl"] == pytest.approx(0.5)


def test_stop_away_from_the_goal_ends_without_success(pointnav: Callable[..., PointNavEnv]) -> None:
    env = pointnav(forward_step_m=0.5)
    env.reset(seed=0, options=STRAIGHT)
    env.step(Action.MOVE_FORWARD)
    _, reward, terminated, _, info = env.step(Action.STOP)
    assert terminated
    assert reward == pytest.approx(-0.01)
    assert (info["is_success"], info["spl"]) == (False, 0.0)
    assert info["soft_spl"] == pytest.approx(0.5)


def test_passing_the_goal_without_stop_is_no_success(pointnav: Callable[..., PointNavEnv]) -> None:
    env = pointnav(forward_step_m=0.5)
    env.reset(seed=0, options=STRAIGHT)
    infos = [env.step(Action.MOVE_FORWARD)[4] for _ in range(2)]
    assert infos[-1]["distance_to_goal_m"] == pytest.approx(0.0, abs=1e-9)
    assert infos[-1]["is_success"] is False


def test_goal_on_the_left_has_a_positive_bearing(pointnav: Callable[..., PointNavEnv]) -> None:
    observation, _ = pointnav().reset(seed=0, options={"start": (1.0, 0.0, 0.0), "goal": (0.5, 0.0)})
    np.testing.assert_allclose(observation["pointgoal_with_gps_compass"], [0.5, np.pi / 2], atol=1e-6)


def test_drawn_goals_keep_their_distance(pointnav: Callable[..., PointNavEnv]) -> None:
    env = pointnav(min_distance_m=2.0, max_distance_m=4.0)
    distances = [env.reset(seed=seed)[1]["distance_to_goal_m"] for seed in range(10)]
    assert min(distances) >= 2.0
    assert max(distances) <= 4.0


def test_goal_at_the_start_is_a_valid_episode(pointnav: Callable[..., PointNavEnv]) -> None:
    env = pointnav()
    observation, _ = env.reset(seed=0, options={"start": (1.0, 0.0, 0.0), "goal": (1.0, 0.0)})
    assert env.observation_space.contains(observation)
    *_, info = env.step(Action.STOP)
    assert (info["is_success"], info["spl"], info["soft_spl"]) == (True, 1.0, 1.0)


def test_goal_in_a_wall_is_refused_with_the_nearest_place(pointnav: Callable[..., PointNavEnv]) -> None:
    with pytest.raises(
        EpisodeError, match=r"`goal` must be on the largest navigable part.*not navigable.*near"
    ):
        pointnav().reset(seed=0, options={"goal": (0.0, 1.0)})


@pytest.mark.parametrize("success_m", [0.0, -1.0, np.nan])
def test_impossible_success_distance_is_refused(success_m: float) -> None:
    with pytest.raises(ValueError, match=f"`success_m` must be > 0, got {success_m}"):
        PointNavEnv(success_m=success_m)


def test_start_without_a_goal_in_range_is_drawn_again(pointnav: Callable[..., PointNavEnv]) -> None:
    env = pointnav(min_distance_m=6.0)
    shortest = []
    for seed in range(30):
        env.reset(seed=seed)
        shortest.append(env._shortest_m)
        np.testing.assert_array_equal(env.trajectory[0].position_xz, env.simulator.state.position_xz)
        np.testing.assert_array_equal(env.reset(seed=seed)[0]["depth"], env.reset(seed=seed)[0]["depth"])
    assert min(shortest) >= 5.7  # by another tree of paths than the one it was drawn from


def test_given_start_without_a_goal_in_range_is_refused(pointnav: Callable[..., PointNavEnv]) -> None:
    with pytest.raises(EpisodeError, match=r"a goal must lie 6\.5 to 30"):
        pointnav(min_distance_m=6.5).reset(seed=0, options={"start": (-0.5, 0.0, 0.0)})
