"""What a learned navigator's network is shown, made from what a point-goal environment observes.

Training, evaluation and the seat under a goal wrapper all go through here. At work the wave is wider than in
training, and moves that cannot help are left out (`NavigatorNetSettings.at_work`, `agents.reflexes`).
"""

from collections.abc import Sequence
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from agents.ego_memory import EgoMemory, spread_pixels
from agents.navigator_net import NUM_PREVIOUS, NavigatorNetSettings
from agents.reflexes import DEFAULT_TURN_RAD, Reflexes
from anm_gym.geometry import CameraSpec

MAX_DEPTH_M: Final = 10.0
"""Depth is clipped to this and divided by it (DD-PPO)."""
Batch = dict[str, NDArray[Any]]


@final
class NavigationObserver:
    """Keep what N agents remember, and make the network's observation of it.

    Args:
        num_agents: N.
        camera: Image size and field of view of all agents' cameras.
        sensor_height_m: Height of each agent's camera, metres.
        forward_step_m: Length of each agent's forward step, metres.
        settings: The network's sizes.
        turn_step_rad: Angle by which all agents turn, radians.
    """

    def __init__(
        self,
        num_agents: int,
        camera: CameraSpec,
        sensor_height_m: float | NDArray[np.floating],
        forward_step_m: float | NDArray[np.floating],
        settings: NavigatorNetSettings,
        turn_step_rad: float = DEFAULT_TURN_RAD,
    ) -> None:
        self.settings = settings
        self._memory = EgoMemory(num_agents, camera, settings.memory) if settings.uses_maps else None
        self._sensor_height_m = np.broadcast_to(np.float32(sensor_height_m), (num_agents,))
        self._forward_step_m = np.broadcast_to(np.float32(forward_step_m), (num_agents,))
        self._actions = np.full(num_agents, NUM_PREVIOUS - 1, np.uint8)
        self._is_start = np.ones(num_agents, bool)
        self._reflexes = Reflexes(num_agents, self._forward_step_m, turn_step_rad=turn_step_rad)
        self._rows, self._columns = (
            spread_pixels(count, settings.image_px) for count in (camera.height_px, camera.width_px)
        )

    def shapes(self) -> dict[str, tuple[tuple[int, ...], type[np.generic]]]:
        """Shape and dtype of every key, for one agent."""
        shapes: dict[str, tuple[tuple[int, ...], type[np.generic]]] = {
            "depth": ((1, len(self._rows), len(self._columns)), np.uint8),
            "goal": ((2,), np.float32),
            "previous_action": ((1,), np.uint8),
            "forward_step_m": ((1,), np.float32),
        }
        if self._memory is not None:
            shapes["maps"] = shapes["waves"] = (self._memory.crop_shape, np.uint8)
        return shapes

    def begin_episode(self, index: int) -> None:
        """Forget what an agent has seen and done."""
        if self._memory is not None:
            self._memory.reset(index)
        self._reflexes.begin(index)
        self._actions[index], self._is_start[index] = NUM_PREVIOUS - 1, True

    def begin_goal(self, index: int, *, shows_start: bool = True) -> None:
        """Forget nothing that was seen or touched at a new goal, as the place is the same.

        Args:
            index: Whose goal it is.
            shows_start: Whether the network is shown the start of an episode.
        """
        self._reflexes.begin_goal(index)
        self._is_start[index] |= shows_start

    def keep(self, agents: Sequence[int]) -> None:
        """Go on with some of the agents only, in the order given."""
        self._sensor_height_m = self._sensor_height_m[agents]
        self._forward_step_m = self._forward_step_m[agents]
        self._actions, self._is_start = self._actions[agents], self._is_start[agents]
        self._reflexes.keep(agents)
        if self._memory is not None:
            self._memory.keep(agents)

    def note(self, actions: NDArray[np.integer]) -> None:
        """Take note of the actions that the N agents carry out now."""
        self._actions[:], self._is_start[:] = actions, False

    def observe(
        self,
        depth_m: NDArray[np.float32],
        world_from_camera: NDArray[np.float32],
        pointgoal: NDArray[np.float32],
    ) -> Batch:
        """Make the observation of all agents.

        Args:
            depth_m: (N, H, W) or (N, H, W, 1) float32 planar depth, metres, 0 is empty.
            world_from_camera: (N, 4, 4) float32 poses of their cameras.
            pointgoal: (N, 2) float32 distance (metres) and bearing (radians, left positive).

        Returns:
            The keys of `shapes`, with a first axis for the agents; see `NavigatorEncoder`.
        """
        self._reflexes.update(world_from_camera, pointgoal[:, 0], self._actions)
        images = depth_m.reshape(depth_m.shape[:3])
        seen = images[:, self._rows[:, None], self._columns]
        scaled = np.rint(np.clip(seen * (255.0 / MAX_DEPTH_M), 0.0, 255.0))
        batch: Batch = {
            "depth": scaled.astype(np.uint8)[:, None],
            "goal": pointgoal.astype(np.float32),
            "previous_action": np.where(self._is_start, NUM_PREVIOUS - 1, self._actions)[:, None],
            "forward_step_m": self._forward_step_m[:, None].copy(),
        }
        if self._memory is not None:
            self._memory.update(
                images, world_from_camera, self._sensor_height_m, self._actions, self._forward_step_m
            )
            batch["maps"] = self._memory.crops(world_from_camera)
            batch["waves"] = self._memory.waves(world_from_camera, _goals_of(world_from_camera, pointgoal))
        return batch

    def allowed(
        self, world_from_camera: NDArray[np.float32], pointgoal: NDArray[np.float32]
    ) -> NDArray[np.bool_]:
        """(N, actions) what is worth a try after `observe`; see `Reflexes`."""
        lost = np.flatnonzero(self._reflexes.lost)
        ahead_m = None
        if self._memory is not None and len(lost) > 0:
            ahead_m = dict(zip(lost, self._memory.ahead(world_from_camera[lost], lost), strict=True))
        return self._reflexes.allowed(world_from_camera, pointgoal[:, 0], ahead_m)


def _goals_of(world_from_camera: NDArray[np.float32], pointgoal: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N, 2) floor points of polar goals."""
    ahead_xz = -world_from_camera[:, [0, 2], 2]
    left_xz = np.stack([ahead_xz[:, 1], -ahead_xz[:, 0]], axis=1)
    distance_m, bearing_rad = pointgoal[:, :1], pointgoal[:, 1:]
    direction = np.cos(bearing_rad) * ahead_xz + np.sin(bearing_rad) * left_xz
    return np.asarray(world_from_camera[:, [0, 2], 3] + distance_m * direction, np.float32)
