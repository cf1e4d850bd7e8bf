"""The discrete actions of the agent, numbered as Habitat numbers them."""

from enum import IntEnum
from typing import Final


class Action(IntEnum):
    """What the agent can do in one step."""

    STOP = 0
    MOVE_FORWARD = 1
    TURN_LEFT = 2
    TURN_RIGHT = 3


MOVES: Final = (Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT)
"""The actions that change the pose."""

FORWARD_STEP_M: Final = 0.065
"""Length of one forward step, metres (Active Neural Mapping, Sec. 5.1)."""

TURN_STEP_DEG: Final = 10.0
"""Angle of one turn, degrees (Active Neural Mapping, Sec. 5.1)."""

MOVED_M: Final = 0.02
"""An agent that came this far has moved, metres, unless half a step is less; see `least_move_m` (ours)."""

NEAREST_STEPS: Final = 0.5
"""Share of a forward step from a place at which no further step need lead nearer to it."""
STRAIGHT_TURNS: Final = 0.51
"""Heading error, in turns, that no turn can lessen: half of one, and a little for rounding (ours)."""


def least_move_m(forward_step_m: float) -> float:
    """Distance from which a step forward counts as a move, metres: what falls short of it met an obstacle."""
    return min(MOVED_M, NEAREST_STEPS * forward_step_m)
