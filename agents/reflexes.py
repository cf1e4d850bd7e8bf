"""Moves that a learned navigator need not try: what the goal sensor and the last steps already tell.

A policy is drawn from a distribution, so a rare mistake happens once in a long episode. Five mistakes can
be told from the observation alone: stopping where the goal is known to be out of reach of success, not
stopping where it is at hand or as near as it gets, walking again into what has just cut a step short,
turning on the spot without end, and going about for long without coming nearer. An agent that does one of
the last two is lost: it stops if it may, and else is led along the wave from its goal, away from the spot
or nearer to the goal.
"""

from collections.abc import Mapping, Sequence
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from agents.patience import Patience
from anm_gym.actions import STRAIGHT_TURNS, TURN_STEP_DEG, Action, least_move_m
from anm_gym.geometry import heading_of, wrap_angle

_FAR_M: Final = 1e9
"""Where an agent was before its episode: nowhere near, metres."""
NEAR_SHARE: Final = 0.75
"""Within this share of the distance of success an agent has arrived: the way is a little longer than the
straight line, which is what it knows, but no wall fits between."""
DEFAULT_TURN_RAD: Final = float(np.deg2rad(TURN_STEP_DEG))
"""Angle of a turn, radians."""
SPOT_M: Final = 0.4
"""An agent that stays within this of a place is on one spot, metres."""
LOST_RAD: Final = float(np.deg2rad(240.0))
"""An agent that has turned so far on one spot is lost, radians: two thirds of the way round."""
AWAY_M: Final = 1.5
"""An agent that turns on one spot is led until it is so far from there, metres."""
LINGER_STEPS: Final = 24
"""An agent that has been within the distance of success for so many steps is as near as it gets."""
MAX_LED_STEPS: Final = 80
"""It is led no longer than this: what leads it may be wrong as well. For one that comes no nearer, which has
farther to go, see `agents.patience`."""
_ROUNDING_RAD: Final = 1e-6
_ONLY: Final = np.eye(len(Action), dtype=bool)
"""Row by row what is allowed if one action alone is."""
_TURNS: Final = (int(Action.TURN_LEFT), int(Action.TURN_RIGHT))


@final
class Reflexes:
    """Remember in which headings each of N agents could not move, and which of them are lost.

    Args:
        num_agents: N.
        forward_step_m: (N,) lengths of their forward steps, metres.
        success_m: Distance within which a stop succeeds, metres.
        turn_step_rad: Angle by which they turn, radians.

    Source:
        Ours.
    """

    def __init__(
        self,
        num_agents: int,
        forward_step_m: float | NDArray[np.floating],
        success_m: float = 0.2,
        turn_step_rad: float = DEFAULT_TURN_RAD,
    ) -> None:
        self._turn_step_rad, self._success_m = turn_step_rad, success_m
        self._near_m = NEAR_SHARE * success_m
        self._same_rad = STRAIGHT_TURNS * turn_step_rad
        self._max_turns = max(2, round(LOST_RAD / turn_step_rad))
        steps_m = np.broadcast_to(np.asarray(forward_step_m), (num_agents,))
        self._least_m = np.array([least_move_m(step_m) for step_m in steps_m.tolist()])
        self._stop_m = np.where(2.0 * steps_m < success_m, self._near_m, success_m)
        self._position_xz = np.full((num_agents, 2), _FAR_M)
        self._blocked_rad: list[list[float]] = [[] for _ in range(num_agents)]
        self._spot_xz = np.full((num_agents, 2), _FAR_M)
        self._turns = np.zeros(num_agents, np.int64)
        self._led_steps = np.zeros(num_agents, np.int64)
        self._near_steps = np.zeros(num_agents, np.int64)
        self._patience = Patience(steps_m)
        self._last_turn = np.full(num_agents, _TURNS[0])

    @property
    def lost(self) -> NDArray[np.bool_]:
        """(N,) which agents get nowhere."""
        return self._turns_about | self._patience.is_over

    @property
    def _turns_about(self) -> NDArray[np.bool_]:
        """(N,) which agents have turned too often on one spot and are still near it."""
        return np.asarray(self._turns >= self._max_turns)

    def begin(self, index: int) -> None:
        """Forget where an agent was."""
        self._position_xz[index] = self._spot_xz[index] = _FAR_M
        self._blocked_rad[index] = []
        self.begin_goal(index)

    def begin_goal(self, index: int) -> None:
        """Forget how often an agent has turned and how near it was; where it could not move stays known."""
        self._turns[index] = self._near_steps[index] = 0
        self._patience.begin_goal(index)

    def keep(self, agents: Sequence[int]) -> None:
        """Go on with some of the agents only, in the order given."""
        self._position_xz, self._spot_xz = self._position_xz[agents], self._spot_xz[agents]
        self._blocked_rad = [self._blocked_rad[agent] for agent in agents]
        self._turns, self._last_turn = self._turns[agents], self._last_turn[agents]
        self._led_steps, self._stop_m = self._led_steps[agents], self._stop_m[agents]
        self._near_steps, self._least_m = self._near_steps[agents], self._least_m[agents]
        self._patience.keep(agents)

    def update(
        self,
        world_from_camera: NDArray[np.float32],
        distance_m: NDArray[np.floating],
        previous: NDArray[np.integer],
    ) -> None:
        """Take note of what the last actions came to.

        Args:
            world_from_camera: (N, 4, 4) float32 poses.
            distance_m: (N,) distances to the goals, metres.
            previous: (N,) the actions that led there.
        """
        self._patience.update(distance_m)
        self._near_steps += distance_m < self._success_m
        position_xz = world_from_camera[:, [0, 2], 3].astype(np.float64)
        moved = np.linalg.norm(position_xz - self._position_xz, axis=1) > self._least_m
        for index in np.flatnonzero(moved):
            self._blocked_rad[index], self._position_xz[index] = [], position_xz[index]
        for index in np.flatnonzero(~moved & (previous == int(Action.MOVE_FORWARD))):
            self._blocked_rad[index].append(heading_of(world_from_camera[index]))
        is_turn = np.isin(previous, _TURNS)
        self._led_steps = np.where(self._turns_about, self._led_steps + 1, 0)
        near_m = np.where(self._turns_about, AWAY_M, SPOT_M)
        has_left = np.linalg.norm(position_xz - self._spot_xz, axis=1) > near_m
        has_left |= self._led_steps > MAX_LED_STEPS
        self._spot_xz = np.where(has_left[:, None], position_xz, self._spot_xz)
        self._turns = np.where(has_left, 0, self._turns + is_turn)
        self._last_turn = np.where(is_turn, previous, self._last_turn)

    def allowed(
        self,
        world_from_camera: NDArray[np.float32],
        distance_m: NDArray[np.floating],
        ahead_m: Mapping[int, NDArray[np.float32]] | None = None,
    ) -> NDArray[np.bool_]:
        """Tell which actions are worth a try.

        Args:
            world_from_camera: (N, 4, 4) float32 poses.
            distance_m: (N,) distances to the goals, metres.
            ahead_m: For each lost agent (K,) how far the goal still is a little ahead, for K headings evenly
                round, the present one first and the others to its left, metres. None if nobody knows: then
                one that turns on a spot may not turn back.

        Returns:
            (N, actions) bool; one at least is always allowed. An agent that has arrived can but stop; one
            with long steps may stop a little before, and one with short steps, which can go on, may not
            unless it lingers there. A lost or lingering agent that may stop does, and one that is led has no
            choice either.
        """
        allowed = np.ones((len(distance_m), len(Action)), bool)
        lingers = self._near_steps >= LINGER_STEPS
        stop_m = np.where(lingers, self._success_m, self._stop_m)
        allowed[:, int(Action.STOP)] = distance_m < stop_m
        for index, blocked in enumerate(self._blocked_rad):
            heading = heading_of(world_from_camera[index])
            if _is_among(heading, blocked, self._same_rad):
                allowed[index, int(Action.MOVE_FORWARD)] = False
        for index, distances_m in (ahead_m or {}).items():
            heading = heading_of(world_from_camera[index])
            move = _lead(distances_m, heading, self._blocked_rad[index], self._turn_step_rad)
            allowed[index] = _ONLY[int(move)]
        if ahead_m is None:
            for turn, back in (_TURNS, _TURNS[::-1]):
                allowed[self._turns_about & (self._last_turn == turn), back] = False
        must_stop = distance_m < np.where(self.lost | lingers, stop_m, self._near_m)
        allowed[must_stop] = _ONLY[int(Action.STOP)]
        return allowed


def _is_among(heading_rad: float, others_rad: Sequence[float], same_rad: float) -> bool:
    return any(abs(wrap_angle(heading_rad - other)) < same_rad for other in others_rad)


def _lead(
    ahead_m: NDArray[np.float32], heading_rad: float, blocked_rad: Sequence[float], turn_step_rad: float
) -> Action:
    """The move towards the heading in which the way is shortest, of those that are not blocked."""
    count = len(ahead_m)
    lefts_rad = [wrap_angle(2.0 * np.pi * index / count) for index in range(count)]
    same_rad = STRAIGHT_TURNS * turn_step_rad
    is_open = [not _is_among(heading_rad + left_rad, blocked_rad, same_rad) for left_rad in lefts_rad]
    left_rad = lefts_rad[int(np.where(is_open, ahead_m, np.inf).argmin())]
    if is_open[0] and abs(left_rad) <= 0.5 * turn_step_rad + _ROUNDING_RAD:
        return Action.MOVE_FORWARD
    return Action.TURN_LEFT if left_rad >= 0.0 else Action.TURN_RIGHT
