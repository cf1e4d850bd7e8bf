"""Moves that a learned navigator need not try: what the goal sensor and the last steps already tell.

A policy is drawn from a distribution, so a rare mistake happens once in a long episode. Two mistakes can
be told from the observation alone: stopping where the goal is known to be out of reach of success, and
walking again into what has just cut a step short.
"""

from collections.abc import Sequence
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from anm_gym.actions import Action
from anm_gym.geometry import heading_of, wrap_angle

MOVED_M: Final = 0.02
"""An agent that moved farther is at another place, metres."""
SAME_RAD: Final = float(np.deg2rad(5.1))
"""Headings that differ less are the same, radians: half a turn."""


@final
class Reflexes:
    """Remember in which headings each of N agents could not move from where it stands.

    Args:
        num_agents: N.
        success_m: Distance within which a stop succeeds, metres.

    Source:
        Ours.
    """

    def __init__(self, num_agents: int, success_m: float = 0.2) -> None:
        self._success_m = success_m
        self._position_xz = np.full((num_agents, 2), np.inf)
        self._blocked_rad: list[list[float]] = [[] for _ in range(num_agents)]

    def begin(self, index: int) -> None:
        """Forget where an agent was."""
        self._position_xz[index] = np.inf
        self._blocked_rad[index] = []

    def keep(self, agents: Sequence[int]) -> None:
        """Go on with some of the agents only, in the order given."""
        self._position_xz = self._position_xz[agents]
        self._blocked_rad = [self._blocked_rad[agent] for agent in agents]

    def update(self, world_from_camera: NDArray[np.float32], previous: NDArray[np.integer]) -> None:
        """Take note of what the last actions came to.

        Args:
            world_from_camera: (N, 4, 4) float32 poses.
            previous: (N,) the actions that led there.
        """
        position_xz = world_from_camera[:, [0, 2], 3].astype(np.float64)
        moved = np.linalg.norm(position_xz - self._position_xz, axis=1) > MOVED_M
        for index in np.flatnonzero(moved):
            self._blocked_rad[index], self._position_xz[index] = [], position_xz[index]
        for index in np.flatnonzero(~moved & (previous == int(Action.MOVE_FORWARD))):
            self._blocked_rad[index].append(heading_of(world_from_camera[index]))

    def allowed(
        self, world_from_camera: NDArray[np.float32], distance_m: NDArray[np.floating]
    ) -> NDArray[np.bool_]:
        """Tell which actions are worth a try.

        Args:
            world_from_camera: (N, 4, 4) float32 poses.
            distance_m: (N,) distances to the goals, metres.

        Returns:
            (N, actions) bool; turns are always allowed.
        """
        allowed = np.ones((len(distance_m), len(Action)), bool)
        allowed[:, int(Action.STOP)] = distance_m < self._success_m
        for index, blocked in enumerate(self._blocked_rad):
            heading = heading_of(world_from_camera[index])
            if any(abs(wrap_angle(heading - other)) < SAME_RAD for other in blocked):
                allowed[index, int(Action.MOVE_FORWARD)] = False
        return allowed
