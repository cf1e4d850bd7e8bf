"""Agents in ever new homes, seen as the network sees them."""

from collections.abc import Callable

import numpy as np
import pytest

from train.navigator.env import FIRST_TRAINING_SEED, DomainSettings, HomeDealer, NavigationVecEnv, step_limit

Navigation = Callable[..., NavigationVecEnv]


def test_agents_stay_for_some_episodes_and_never_see_a_home_for_evaluation() -> None:
    dealer = HomeDealer(DomainSettings(tiers={"flat": 0.5, "house": 0.5}, episodes_per_home=2), 2, seed=1)
    homes = [dealer(0)["scene"] for _ in range(40)]
    assert homes[::2] == homes[1::2]
    assert len(set(homes)) == 20
    assert {home.split(":")[1] for home in homes} == {"flat", "house"}
    assert min(int(home.split(":")[2]) for home in homes) >= FIRST_TRAINING_SEED
    assert dealer(1)["scene"] not in homes


def test_teacher_solves_every_episode(navigation: Navigation) -> None:
    env = navigation(4)
    env.reset()
    infos = []
    for _ in range(150):
        _, _, dones, step_infos = env.step(env.teacher_actions())
        infos += [info for info, done in zip(step_infos, dones, strict=True) if done]
    assert len(infos) > 3
    assert all(info["is_success"] for info in infos)
    assert np.mean([info["spl"] for info in infos]) > 0.9


def test_bodies_differ_between_agents(navigation: Navigation) -> None:
    env = navigation(8, forward_step_m=(0.1, 0.25), sensor_height_m=(1.0, 1.5))
    observation = env.reset()
    np.testing.assert_allclose(observation["forward_step_m"].ravel(), [0.1, 0.25] * 4)
    heights = [agent.camera.sensor_height_m for agent in env.agents]
    assert heights == [1.0, 1.0, 1.5, 1.5] * 2


def test_time_limit_ends_an_episode_for_good(navigation: Navigation) -> None:
    env = navigation(1, max_steps=2)
    env.reset()
    env.step(np.array([2]))
    observation, _, dones, infos = env.step(np.array([2]))
    assert dones[0]
    assert not {"TimeLimit.truncated", "terminal_observation"} & infos[0].keys()
    assert observation["previous_action"][0, 0] == 4, "an episode begins without a previous action"


def test_same_seed_same_episodes(navigation: Navigation, rng: np.random.Generator) -> None:
    first, second = navigation(2, seed=5), navigation(2, seed=5)
    seen, again = first.reset(), second.reset()
    for _ in range(20):
        for key, values in seen.items():
            np.testing.assert_array_equal(values, again[key])
        actions = rng.integers(1, 4, size=2)
        (seen, *_), (again, *_) = first.step(actions), second.step(actions)


def test_step_limit_is_habitats_way() -> None:
    assert step_limit(0.25) == 500
    assert step_limit(0.065) == 1923


def test_tiers_without_a_share_are_refused() -> None:
    with pytest.raises(ValueError, match=r"`tiers` must have shares >= 0 with a positive sum, got \{\}"):
        DomainSettings(tiers={})
