"""Agents without a map: the floor that every method must beat."""

from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from agents.batching import actions_for
from agents.draws import draws_of
from anm_gym.actions import FORWARD_STEP_M, MOVES, TURN_STEP_DEG, Action, least_move_m
from anm_gym.checks import check_known

BUMP_TURN_DEG: Final = (30.0, 180.0)
"""Least and largest turn after a bump, degrees."""
MAX_WALK_M: Final = 3.9
"""Longest walk between two looks round, metres."""
FORWARD_SHARES: Final = {"uniform": 1.0 / 3.0, "forward": 0.8}
"""Chance of a step forward; what remains goes to both turns alike. A turn of 10 degrees one way undoes one
the other way, so `uniform` mostly looks about on the spot; `forward` gets somewhere (ours)."""


@final
class RandomPolicy:
    """Draw one of the three moves, by default uniformly.

    Stop is never drawn: the published code has a variant in which it is and does nothing, but here
    it ends the episode.

    Args:
        seed: Seeds the draws; they start anew with each episode.
        preset: One of `FORWARD_SHARES`.

    Raises:
        ValueError: If the preset is unknown.

    Source:
        Active Neural Mapping, Table 1, "Random": `uniform`.
    """

    def __init__(self, seed: int = 0, preset: str = "uniform") -> None:
        check_known("random preset", preset, FORWARD_SHARES)
        self._seed, self._rng = seed, draws_of(seed)
        self._is_uniform, share = preset == "uniform", FORWARD_SHARES[preset]
        self._chances = [share if move is Action.MOVE_FORWARD else 0.5 * (1.0 - share) for move in MOVES]

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,  # noqa: ARG002 - always drawn
    ) -> tuple[NDArray[np.int64], Any]:
        """Choose an action; the signature is Stable-Baselines3's."""
        if episode_start is not None and np.any(episode_start):
            self._rng = draws_of(self._seed)
        return actions_for(observation, MOVES[self._draw()]), state

    def _draw(self) -> int:
        if self._is_uniform:
            return int(self._rng.integers(len(MOVES)))
        return int(self._rng.choice(len(MOVES), p=self._chances))


@final
class BumpAndTurnPolicy:
    """Go straight until a step is blocked, then turn by a random angle (ours).

    Args:
        seed: Seeds the angles; they start anew with each episode.
        forward_step_m: Length of one step, metres.
        turn_step_deg: Angle of one turn, degrees.
    """

    def __init__(
        self,
        seed: int = 0,
        forward_step_m: float = FORWARD_STEP_M,
        turn_step_deg: float = TURN_STEP_DEG,
    ) -> None:
        self._seed, self._least_m = seed, least_move_m(forward_step_m)
        self._turns = [max(1, round(angle / turn_step_deg)) for angle in BUMP_TURN_DEG]
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
        if self._walked and np.linalg.norm(position - self._position) < self._least_m:
            self._turns_left = int(self._rng.integers(self._turns[0], self._turns[1] + 1))
            self._turn = Action.TURN_LEFT if self._rng.random() < 0.5 else Action.TURN_RIGHT
        self._position, self._walked = position, self._turns_left == 0
        if self._walked:
            return actions_for(observation, Action.MOVE_FORWARD), state
        self._turns_left -= 1
        return actions_for(observation, self._turn), state

    def _restart(self) -> None:
        self._rng = draws_of(self._seed)
        self._turns_left, self._turn = 0, Action.TURN_LEFT
        self._walked = False


@final
class SpinAndWalkPolicy:
    """Look all round, turn to a random heading, walk until a step is blocked or 3.9 m are done (ours).

    Args:
        seed: Seeds headings and lengths; they start anew with each episode.
        forward_step_m: Length of one step, metres.
        turn_step_deg: Angle of one turn, degrees.
    """

    def __init__(
        self,
        seed: int = 0,
        forward_step_m: float = FORWARD_STEP_M,
        turn_step_deg: float = TURN_STEP_DEG,
    ) -> None:
        self._seed, self._least_m = seed, least_move_m(forward_step_m)
        self._full_turns = max(1, round(360.0 / turn_step_deg))
        self._max_walk = max(1, round(MAX_WALK_M / forward_step_m))
        self._position: NDArray[np.float64] = np.zeros(2)
        self._walked = False
        self._turns_left = self._steps_left = 0
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
        is_blocked = self._walked and np.linalg.norm(position - self._position) < self._least_m
        if is_blocked or (self._turns_left == 0 and self._steps_left == 0):
            self._turns_left = self._full_turns + int(self._rng.integers(self._full_turns))
            self._steps_left = int(self._rng.integers(1, self._max_walk + 1))
        self._position, self._walked = position, self._turns_left == 0
        if self._walked:
            self._steps_left -= 1
            return actions_for(observation, Action.MOVE_FORWARD), state
        self._turns_left -= 1
        return actions_for(observation, Action.TURN_LEFT), state

    def _restart(self) -> None:
        self._rng = draws_of(self._seed)
        self._turns_left = self._steps_left = 0
        self._walked = False
