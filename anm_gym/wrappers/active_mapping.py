"""`ANM/ActiveMapping-v0`: exploration with the learned map and its goals on top."""

from typing import Any

import gymnasium

from anm_gym.envs.explore import ExploreEnv
from anm_gym.wrappers.neural_map import NeuralMapWrapper
from anm_gym.wrappers.variability_goal import VariabilityGoalWrapper


def make_active_mapping(preset: str = "best", seed: int = 0, **explore: Any) -> gymnasium.Env[Any, Any]:
    """Build Explore under both wrappers; the entry point of `ANM/ActiveMapping-v0`.

    Args:
        preset: Preset of map and goals: `best`, `fast`, `paper` or `released`.
        seed: Seeds map and goals, together with the seed of `reset`.
        **explore: Arguments of `ExploreEnv`.

    Returns:
        A point-goal environment whose goals explore the scene.
    """
    mapped = NeuralMapWrapper(ExploreEnv(**explore), preset=preset, seed=seed)
    return VariabilityGoalWrapper(mapped, preset=preset, seed=seed)
