"""Which agents come no nearer to their goals, whatever they do, and are better led for a while."""

from collections.abc import Sequence
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

PATIENCE_M: Final = 30.0
"""Patience ends after as many steps as would carry an agent so far, metres; it is led for as many."""
NEARER_M: Final = 0.02
"""An agent comes nearer if it is by more than this nearer than ever, metres."""


@final
class Patience:
    """Count the steps that each of N agents has taken since it was nearest to its goal.

    Args:
        forward_step_m: (N,) lengths of their forward steps, metres.

    Source:
        Ours.
    """

    def __init__(self, forward_step_m: NDArray[np.floating]) -> None:
        self._limit = np.rint(PATIENCE_M / forward_step_m).astype(np.int64)
        self._idle_steps = np.zeros(len(forward_step_m), np.int64)
        self._nearest_m = np.full(len(forward_step_m), np.inf)

    @property
    def is_over(self) -> NDArray[np.bool_]:
        """(N,) which agents have not come nearer for long."""
        return np.asarray(self._idle_steps >= self._limit)

    def begin_goal(self, index: int) -> None:
        """Have patience again with one agent."""
        self._idle_steps[index], self._nearest_m[index] = 0, np.inf

    def keep(self, agents: Sequence[int]) -> None:
        """Go on with some of the agents only, in the order given."""
        self._limit, self._idle_steps = self._limit[agents], self._idle_steps[agents]
        self._nearest_m = self._nearest_m[agents]

    def update(self, distance_m: NDArray[np.floating]) -> None:
        """Take note of one more step.

        Args:
            distance_m: (N,) distances to the goals, metres.
        """
        is_nearer = distance_m < self._nearest_m - NEARER_M
        self._nearest_m = np.where(is_nearer, distance_m, self._nearest_m)
        idle_steps = (self._idle_steps + 1) % (2 * self._limit)
        self._idle_steps = np.where(is_nearer & ~self.is_over, 0, idle_steps)
