"""Wrappers say what they need before anything goes wrong."""

from collections.abc import Callable

import gymnasium
import pytest
from gymnasium import spaces

from anm_gym.wrappers.coverage_reward import CoverageRewardWrapper
from anm_gym.wrappers.neural_map import NeuralMapWrapper
from anm_gym.wrappers.occupancy import OccupancyWrapper
from anm_gym.wrappers.policy_view import PolicyViewWrapper

WRAPPERS = [NeuralMapWrapper, OccupancyWrapper, PolicyViewWrapper]


@pytest.mark.parametrize("wrapper", WRAPPERS)
def test_environment_of_another_kind_is_refused(wrapper: Callable[[gymnasium.Env], gymnasium.Env]) -> None:
    with pytest.raises(ValueError, match="`env` must have the observations of ANM/Explore-v0, got Box"):
        wrapper(gymnasium.make("CartPole-v1"))


def test_environment_without_a_camera_or_a_floor_is_refused() -> None:
    class Blind(gymnasium.Env):
        observation_space = spaces.Dict(
            {"depth": spaces.Box(0, 1, (2, 2, 1)), "world_from_camera": spaces.Box(0, 1, (4, 4))}
        )
        action_space = spaces.Discrete(4)

    with pytest.raises(ValueError, match="`env` must have a `camera`, as ANM/Explore-v0 has, got none"):
        NeuralMapWrapper(Blind())
    with pytest.raises(TypeError, match="`env` must be made of ANM/Explore-v0, got CartPoleEnv"):
        CoverageRewardWrapper(gymnasium.make("CartPole-v1"))
