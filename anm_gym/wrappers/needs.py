"""What wrappers need of the environment below them, asked for before anything goes wrong."""

from typing import Any

import gymnasium
from gymnasium import spaces


def require_exploration(env: gymnasium.Env[Any, Any]) -> None:
    """Refuse an environment without the observations of `ANM/Explore-v0`.

    Raises:
        ValueError: If there is no depth or no pose in its observations, or it has no camera.
    """
    space = env.observation_space
    keys = set(space.spaces) if isinstance(space, spaces.Dict) else set()
    if not {"depth", "world_from_camera"} <= keys:
        raise ValueError(f"`env` must have the observations of ANM/Explore-v0, got {space}")
    if not env.has_wrapper_attr("camera"):
        raise ValueError("`env` must have a `camera`, as ANM/Explore-v0 has, got none")


def require_steps(env: gymnasium.Env[Any, Any]) -> None:
    """Refuse an environment that does not say how far its actions go.

    Raises:
        ValueError: If it has no `step_sizes`.
    """
    if not env.has_wrapper_attr("step_sizes"):
        raise ValueError(
            "`env` must have `step_sizes`, metres of a step forward and radians of a turn, as ANM/Explore-v0 "
            "has, got none"
        )
