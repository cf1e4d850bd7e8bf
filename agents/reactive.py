"""Agents without a map: the floor that every method must beat."""

from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from agents.batching import actions_for
from anm_gym.actions import MOVES, Action

BLOCKED_M: Final = 0.02
"""A forward step that is shorter than this met an obstacle, metres."""
MIN_TURNS: Final = 3
"""Least number of turns after a bump: 30 degrees."""
MAX_TURNS: Final = 18
"""Largest number of turns after a bump: 180 degrees."""


@final
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
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,  # noqa: ARG002 - always drawn
    ) -> tuple[NDArray[np.int64], Any]:
        """Choose an action; the signature is Stable-Baselines3's."""
        if episode_start is not None and np.any(episode_start):
            self._rng = np.random.default_rng(self._seed)
        return actions_for(observation, MOVES[self._rng.integers(len(MOVES))]), state


@final
class BumpAndTurnPolicy:
    """Go straight until a step is blocked, then turn by a random angle (ours).

    Args:
        seed: Seeds the angles; they start anew with each episode.
    """

    def __init__(self, seed: int = 0) -> None:
        self._seed = seed
        self._position: NDArray[np.float64] = np.zeros(2)
        self._walked = False
        self._restart()

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,  # noqa: ARG002 - always drawn
    ) -> tuple[NDArray[np.int64], Any]:
        """Choose an action; the signature is Stable-Baselines3's."""
        if episode_start is not None and np.any(episode_start):
            self._restart()
        position = np.asarray(observation["gps"], np.float64).reshape(2)
        if self._walked and np.linalg.norm(position - self._position) < BLOCKED_M:
            self._turns_left = int(self._rng.integers(MIN_TURNS, MAX_TURNS + 1))
            self._turn = Action.TURN_LEFT if self._rng.random() < 0.5 else Action.TURN_RIGHT
        self._position, self._walked = position, self._turns_left == 0
        if self._walked:
            return actions_for(observation, Action.MOVE_FORWARD), state
        self._turns_left -= 1
        return actions_for(observation, self._turn), state

    def _restart(self) -> None:
        self._rng = np.random.default_rng(self._seed)
        self._turns_left, self._turn = 0, Action.TURN_LEFT
        self._walked = False
