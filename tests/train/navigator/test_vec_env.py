"""The library's vectorised form is bit-equal to single environments under its own wrapper."""

import numpy as np
import pytest
from gymnasium.wrappers import TimeLimit
from stable_baselines3.common.vec_env import DummyVecEnv

from anm_gym.envs.pointnav import PointNavEnv
from train.navigator.vec_env import PointNavVecEnv

SCENE, CAMERA = "home:studio:3", {"width_px": 16, "height_px": 16}


def make_env() -> PointNavEnv:
    return PointNavEnv(SCENE, camera=CAMERA, forward_step_m=0.25)


def test_it_does_what_the_librarys_own_does(rng: np.random.Generator) -> None:
    dummy = DummyVecEnv([lambda: TimeLimit(make_env(), 9) for _ in range(2)])
    together = PointNavVecEnv([make_env(), make_env()], 9)
    for venv in (dummy, together):
        venv.seed(4)
    first, second = dummy.reset(), together.reset()
    for _ in range(30):
        for key, values in first.items():
            np.testing.assert_array_equal(values, second[key])
        actions = rng.choice(4, size=2, p=[0.05, 0.6, 0.2, 0.15])
        (first, *expected, expected_infos), (second, *parts, infos) = (
            dummy.step(actions),
            together.step(actions),
        )
        for expected_part, part in zip(expected, parts, strict=True):
            np.testing.assert_array_equal(expected_part, part)
        for expected_info, info in zip(expected_infos, infos, strict=True):
            assert expected_info.keys() == info.keys()
            assert expected_info["TimeLimit.truncated"] == info["TimeLimit.truncated"]
            if "terminal_observation" in info:
                np.testing.assert_array_equal(
                    expected_info["terminal_observation"]["depth"], info["terminal_observation"]["depth"]
                )


def test_options_choose_the_next_episodes_scene() -> None:
    names = ["home:studio:1", "home:studio:2", "home:studio:5"]
    dealt = iter(names)
    venv = PointNavVecEnv([make_env()], 1, lambda _: {"scene": next(dealt)})
    venv.reset()
    seen = [venv.envs[0].scene.name]
    for _ in range(2):
        venv.step(np.array([1]))
        seen.append(venv.envs[0].scene.name)
    assert seen == names


def test_limits_may_differ_and_none_is_an_error() -> None:
    venv = PointNavVecEnv([make_env(), make_env()], [1, 3])
    venv.reset()
    ends = [venv.step(np.array([2, 2]))[2].tolist() for _ in range(3)]
    assert ends == [[True, False], [True, False], [True, True]]
    with pytest.raises(ValueError, match="`envs` must have at least one environment, got none"):
        PointNavVecEnv([])


def test_attributes_and_methods_reach_the_environments() -> None:
    venv = PointNavVecEnv([make_env(), make_env()])
    venv.reset()
    assert venv.get_attr("collisions") == [0, 0]
    venv.set_attr("collisions", 3, indices=1)
    assert venv.get_attr("collisions", [1]) == [3]
    assert venv.env_method("get_wrapper_attr", "path_length_m", indices=0) == [0.0]
    assert venv.env_is_wrapped(TimeLimit) == [False, False]
