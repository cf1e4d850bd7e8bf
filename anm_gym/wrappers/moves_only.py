"""Exploration without an end of the agent's own: its actions are the three moves."""

from typing import final

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

from anm_gym.actions import MOVES
from anm_gym.envs.mesh_env import Observation


@final
class MovesOnlyWrapper(gymnasium.ActionWrapper[Observation, np.int64, np.int64], RecordConstructorArgs):
    """Take stop away, which ends an episode of exploration for nothing.

    ## Action
    `Discrete(3)`: 0 move forward, 1 turn left, 2 turn right.

    ## Observation, reward, information
    Unchanged.

    ## Episode end
    Truncated only.

    ## Needs
    The actions of `ANM/Explore-v0`.

    Example:
        >>> env = MovesOnlyWrapper(gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0"))
        >>> env.action_space
        Discrete(3)

    ## Version history
    - v0: first version.
    """

    def __init__(self, env: gymnasium.Env[Observation, np.int64]) -> None:
        RecordConstructorArgs.__init__(self)
        super().__init__(env)
        self.action_space = spaces.Discrete(len(MOVES))

    def action(self, action: np.int64) -> np.int64:
        """Number a move as Explore does.

        Raises:
            ValueError: If there is no such move.
        """
        if not self.action_space.contains(action):
            raise ValueError(f"`action` must be one of {list(range(len(MOVES)))}, got {action!r}")
        return np.int64(MOVES[int(action)])
