"""Wrappers say what they need before anything goes wrong."""

from collections.abc import Callable

import gymnasium
import pytest

from anm_gym.wrappers.coverage_reward import CoverageRewardWrapper
from anm_gym.wrappers.neural_map import NeuralMapWrapper
from anm_gym.wrappers.occupancy import OccupancyWrapper
from anm_gym.wrappers.policy_view import PolicyViewWrapper

WRAPPERS = [CoverageRewardWrapper, NeuralMapWrapper, OccupancyWrapper, PolicyViewWrapper]


@pytest.mark.parametrize("wrapper", WRAPPERS)
def test_environment_of_another_kind_is_refused(wrapper: Callable[[gymnasium.Env], gymnasium.Env]) -> None:
    with pytest.raises(ValueError, match="`env` must have the observations of ANM/Explore-v0, got Box"):
        wrapper(gymnasium.make("CartPole-v1"))
