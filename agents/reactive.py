"""Agents without a map: the floor that every method must beat."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from anm_gym.actions import MOVES, Action


class RandomPolicy:
    """Draw one of the three moves uniformly.

    Args:
        seed: Seeds the draws; they start anew with each episode.

    Source:
        Active Neural Mapping, Table 1, "Random".
    """

    def __init__(self, seed: int = 0) -> None:
        self._seed, self._rng = seed, np.random.default_rng(seed)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[NDArray[np.int64], Any]:
        """Choose an action; the signature is Stable-Baselines3's."""
        if episode_start is not None and np.any(episode_start):
            self._rng = np.random.default_rng(self._seed)
        return np.array(int(MOVES[self._rng.integers(len(MOVES))])), state


class BumpAndTurnPolicy:
    """Go straight until something is near, then turn by a random angle (ours).

    Args:
        seed: Seeds the angles.
        near_m: Depth ahead under which the agent turns, metres.
    """

    def __init__(self, seed: int = 0, near_m: float = 0.4) -> None:
        self._seed, self._near_m = seed, near_m
        self._restart()

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[NDArray[np.int64], Any]:
        """Choose an action; the signature is Stable-Baselines3's."""
        if episode_start is not None and np.any(episode_start):
            self._restart()
        if self._turns_left == 0 and self._is_near(np.asarray(observation["depth"])):
            self._turns_left = int(self._rng.integers(3, 19))
            self._turn = Action.TURN_LEFT if self._rng.random() < 0.5 else Action.TURN_RIGHT
        if self._turns_left > 0:
            self._turns_left -= 1
            return np.array(int(self._turn)), state
        return np.array(int(Action.MOVE_FORWARD)), state

    def _restart(self) -> None:
        self._rng = np.random.default_rng(self._seed)
        self._turns_left, self._turn = 0, Action.TURN_LEFT

    def _is_near(self, depth_m: NDArray[np.float32]) -> bool:
        """Something stands in the middle of the image, from the horizon down."""
        height, width = depth_m.shape[:2]
        ahead = depth_m[height // 2 : 3 * height // 4, 3 * width // 8 : 5 * width // 8]
        return bool((ahead[ahead > 0.0] < self._near_m).any())
