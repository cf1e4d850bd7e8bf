"""What every navigator is: something that drives an environment towards the goals of a wrapper.

Navigators implement Stable-Baselines3's `predict`, so that a learned policy and a classical one take
the same seat.
"""

from abc import ABC, abstractmethod
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from agents.batching import actions_for
from anm_gym.actions import Action
from anm_gym.geometry import wrap_angle
from anm_gym.stopwatch import Stopwatch
from anm_gym.wrappers.goal import Goal, GoalWrapper

State = tuple[NDArray[Any], ...] | None


class Navigator(ABC):
    """Drive an environment that sits under a `GoalWrapper`.

    Args:
        env: The environment, with a `GoalWrapper` as its outermost layer.
        seed: Seeds what is drawn.
    """

    def __init__(self, env: GoalWrapper, seed: int = 0) -> None:
        self.env = env
        self._seed = seed
        self.stopwatch = Stopwatch()
        self.compute_ms: Final = self.stopwatch.compute_ms
        self._episode = env.num_episodes
        self._forget()

    def predict(
        self,
        observation: Any,
        state: State = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,  # noqa: ARG002 - a navigator's own settings decide
    ) -> tuple[NDArray[np.int64], State]:
        """Choose an action; the signature is Stable-Baselines3's.

        What was seen in an episode before is forgotten, whether or not `episode_start` tells of a new one.

        Args:
            observation: The environment's last observation, single or of a vector of one.
            state: Ignored and handed back: a navigator keeps its own.
            episode_start: Whether this is the first step of an episode.
            deterministic: Ignored.

        Returns:
            The action as a () or (1,) int64 array, as the observation is shaped, and the state.
        """
        if self._episode != self.env.num_episodes or (episode_start is not None and np.any(episode_start)):
            self.begin_episode()
        return actions_for(observation, self._act(observation)), state

    def begin_episode(self) -> None:
        """Forget the last episode."""
        self._episode = self.env.num_episodes
        self.stopwatch.reset()
        self._forget()

    @abstractmethod
    def _forget(self) -> None:
        """Begin an episode."""

    @abstractmethod
    def _act(self, observation: Any) -> Action:
        """Choose an action."""

    def _distance_m(self, point_xz: NDArray[np.float64]) -> float:
        return float(np.linalg.norm(point_xz - self.env.position_xz))

    def _heading_error_rad(self, goal: Goal) -> float:
        """Turn to the goal's heading; 0 where it does not matter."""
        return 0.0 if goal.heading_rad is None else wrap_angle(goal.heading_rad - self.env.heading_rad)
