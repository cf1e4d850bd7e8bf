"""How the body moves over the traversable grid: straight, until it touches something."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anm_gym.geometry import forward_xz
from anm_gym.sim.traversable import TraversableGrid

SUBSTEP_M = 0.01
"""Resolution at which contact is looked for, metres; a fifth of the default cell."""
FREE_STEPS = 1.5
"""With so many steps of clearance beside its radius the body cannot touch anything: interpolated
clearance changes by at most sqrt(2) metres per metre."""
BISECTIONS = 14
"""Halvings of the last substep: contact is found to a micrometre."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Outcome of one action."""

    position_xz: NDArray[np.float64]
    """(2,) floor point after it, metres."""
    travelled_m: float
    """Distance moved, metres."""
    collided: bool
    """Whether contact cut the move short."""


def move_forward(
    grid: TraversableGrid, position_xz: NDArray[np.float64], heading_rad: float, step_m: float
) -> Motion:
    """Move straight ahead; stop at the first contact, never slide.

    Contact is where the interpolated clearance equals the body's radius. The move also ends before
    another connected part, so that the path walked always exists on the grid.

    Args:
        grid: Where the body fits.
        position_xz: (2,) start, metres.
        heading_rad: Direction, radians.
        step_m: Length of the move, metres.

    Returns:
        The motion; its end is navigable if its start is.

    Source:
        Active Neural Mapping, Sec. 5.1: no sliding. The contact model is ours.
    """
    direction = forward_xz(heading_rad)
    if grid.clearance_at(position_xz) > grid.body.radius_m + FREE_STEPS * step_m:
        return Motion(position_xz + step_m * direction, step_m, False)
    component = grid.component_at(position_xz)

    def fits(travelled_m: float) -> bool:
        return component > 0 and grid.component_at(position_xz + travelled_m * direction) == component

    count = max(1, int(np.ceil(step_m / SUBSTEP_M - 1e-9)))
    reached_m = 0.0
    for ahead_m in np.linspace(0.0, step_m, count + 1)[1:].tolist():
        if not fits(ahead_m):
            reached_m = _contact(fits, reached_m, ahead_m)
            return Motion(position_xz + reached_m * direction, reached_m, True)
        reached_m = ahead_m
    return Motion(position_xz + reached_m * direction, reached_m, False)


def _contact(fits: Callable[[float], bool], free_m: float, blocked_m: float) -> float:
    """Halve the way between a place that fits and one that does not; the last that fits."""
    for _ in range(BISECTIONS):
        middle_m = 0.5 * (free_m + blocked_m)
        free_m, blocked_m = (middle_m, blocked_m) if fits(middle_m) else (free_m, middle_m)
    return free_m
