"""An occupancy grid under whatever is built on one: rewards, observations of policies.

Goal wrappers keep a grid of their own, or that of a neural map; this is for environments without.
"""

from typing import Any, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from anm_gym.envs.mesh_env import Observation
from anm_gym.errors import MapError
from anm_gym.map.occupancy import OccupancyGrid, OccupancySettings
from anm_gym.wrappers.needs import require_exploration


@final
class OccupancyWrapper(
    gymnasium.Wrapper[Observation, np.int64, Observation, np.int64], RecordConstructorArgs
):
    """Log every depth image, and every contact, in an `OccupancyGrid`.

    ## Observation, action, reward, episode end, information
    Unchanged. The grid is reached by ``env.get_wrapper_attr("occupancy")``.

    ## Needs
    Observations of `ANM/Explore-v0`.

    Args:
        env: An exploration environment.
        cell_m: Edge of a cell, metres; coarser than for planning, as it is for looking at.

    Example:
        >>> env = gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0")
        >>> env = OccupancyWrapper(env)
        >>> observation, info = env.reset(seed=0)
        >>> bool(env.occupancy.free.any())
        True

    ## Version history
    - v0: first version.
    """

    def __init__(self, env: gymnasium.Env[Observation, np.int64], *, cell_m: float = 0.1) -> None:
        RecordConstructorArgs.__init__(self, cell_m=cell_m)
        super().__init__(env)
        require_exploration(env)
        self.settings = OccupancySettings(cell_m=cell_m)
        self.occupancy = OccupancyGrid(floor_y_m=0.0, settings=self.settings)
        """What is known of the floor in the current episode."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode with an empty grid."""
        observation, info = self.env.reset(seed=seed, options=options)
        camera, pose = self.get_wrapper_attr("camera"), observation["world_from_camera"].astype(np.float64)
        self.occupancy = OccupancyGrid.below(camera, pose, self.settings)
        self._log(observation)
        return observation, info

    def step(self, action: np.int64) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act, then log what is seen."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._log(observation)
        if info.get("collided", False):
            self.occupancy.mark_contact(observation["world_from_camera"].astype(np.float64))
        return observation, float(reward), terminated, truncated, info

    def _log(self, observation: Observation) -> None:
        pose = observation["world_from_camera"].astype(np.float64)
        self.occupancy.integrate(observation["depth"], self.get_wrapper_attr("camera"), pose)


def has_occupancy(env: gymnasium.Env[Any, Any]) -> bool:
    """Tell whether an environment or a wrapper in it keeps an occupancy grid."""
    try:
        return env.has_wrapper_attr("occupancy")
    except (gymnasium.error.ResetNeeded, MapError):  # a goal wrapper, which has one from `reset` on
        return True
