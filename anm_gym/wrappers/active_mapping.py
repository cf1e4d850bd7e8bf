"""`ANM/ActiveMapping-v0`: exploration with the learned map and its goals on top."""

from typing import Any

import gymnasium

from anm_gym.envs.explore import ExploreEnv
from anm_gym.wrappers.neural_map import NeuralMapWrapper
from anm_gym.wrappers.variability_goal import VariabilityGoalWrapper


def make_active_mapping(preset: str = "best", seed: int = 0, **explore: Any) -> gymnasium.Env[Any, Any]:
    """Build Explore under both wrappers; the entry point of `ANM/ActiveMapping-v0`.

    ## Description
    An agent learns a map of the storey while it moves, and is told at every step where the map is least
    sure of itself. A policy that reaches point goals, such as one of `ANM/PointNav-v0`, thereby explores.

    ## Action space, rewards, starting state, episode end
    Those of `ANM/Explore-v0`.

    ## Observation space
    That of `ANM/Explore-v0` and `pointgoal_with_gps_compass`, (2,) float32: distance (metres) and bearing
    (radians, left positive) of the current goal. A goal that is reached or given up is replaced.

    ## Information
    Those of `ANM/Explore-v0`, of `NeuralMapWrapper` (`is_keyframe`, `map_iterations`, losses) and of
    `GoalWrapper` (`goal_distance_m`, `goals_count`, `handovers_count`). The map is reached by
    ``env.get_wrapper_attr("neural_map")``.

    Args:
        preset: Preset of map and goals: `best`, `fast`, `paper` or `released`.
        seed: Seeds map and goals, together with the seed of `reset`.
        **explore: Arguments of `ExploreEnv`.

    Returns:
        A point-goal environment whose goals explore the scene.

    Raises:
        ValueError: If the preset is unknown, or an argument out of its range.
        SceneError: If the scene cannot be used.

    Source:
        Active Neural Mapping, Sec. 4.

    ## Version History
    - v0: first version.
    """
    mapped = NeuralMapWrapper(ExploreEnv(**explore), preset=preset, seed=seed)
    return VariabilityGoalWrapper(mapped, preset=preset, seed=seed)
