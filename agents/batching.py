"""Single and batched observations: Stable-Baselines3 evaluates policies on vectors of environments."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from anm_gym.actions import Action


def actions_for(observation: Any, action: Action) -> NDArray[np.int64]:
    """Shape an action as the observation is shaped.

    Args:
        observation: Observation of `ANM/Explore-v0`, single or of a vector of one environment.
        action: What to do.

    Returns:
        () int64, or (1,) int64 for a vector.

    Raises:
        ValueError: If there are more environments than one: these agents keep the state of one.
    """
    compass = np.asarray(observation["compass"])
    if compass.ndim == 1:
        return np.array(int(action), np.int64)
    if len(compass) != 1:
        raise ValueError(
            f"`observation` must be of one environment, got {len(compass)}; use one agent for each"
        )
    return np.array([int(action)], np.int64)
