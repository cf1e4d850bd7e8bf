"""The reward of a learned explorer, made of what Explore pays, what the map gains and what moving costs."""

from dataclasses import dataclass
from typing import Any, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from anm_gym.checks import check_at_least
from anm_gym.envs.explore import ExploreEnv
from anm_gym.envs.mesh_env import Observation
from anm_gym.wrappers.occupancy import has_occupancy


@dataclass(frozen=True)
class CoverageWeights:
    """What a step is paid for (ours)."""

    floor: float = 1.0
    """Per square metre of reachable floor that is seen for the first time: the reward of Explore."""
    known: float = 0.0
    """Per square metre of the occupancy grid that becomes known, free or occupied."""
    collision: float = 0.1
    """Taken off for a step that ends at contact."""
    slack: float = 0.01
    """Taken off for every step."""

    def __post_init__(self) -> None:
        check_at_least(self, 0.0, "floor", "known", "collision", "slack")


@final
class CoverageRewardWrapper(
    gymnasium.Wrapper[Observation, np.int64, Observation, np.int64], RecordConstructorArgs
):
    """Pay for what is seen of a scene.

    ## Observation, action, episode end
    Unchanged.

    ## Reward
    `r_t = floor * (A_t - A_(t-1)) + known * (K_t - K_(t-1)) - collision * c_t - slack`, with the
    reachable floor A that has been seen, as `ANM/Explore-v0` pays it, and the known area K of the
    occupancy grid, both in square metres; c is 1 for a step that ends at contact, else 0. A is
    measured on the true floor, K is what an agent could measure of itself.

    ## Information
    Adds `coverage` (float): the share of the reachable floor that has been seen, 0 to 1, where
    Explore pays for the floor.

    ## Needs
    `ANM/Explore-v0`; for `floor`, with its own reward; for `known`, an occupancy grid below, such as that of
    `OccupancyWrapper`.

    Args:
        env: An exploration environment.
        floor, known, collision, slack: The fields of `CoverageWeights`.

    Raises:
        TypeError: If `env` is made of another environment.
        ValueError: If it lacks what is paid for.

    Example:
        >>> env = gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0")
        >>> env = CoverageRewardWrapper(env)
        >>> observation, info = env.reset(seed=0)
        >>> 0.0 < info["coverage"] < 1.0
        True

    ## Version history
    - v0: first version.
    """

    def __init__(
        self,
        env: gymnasium.Env[Observation, np.int64],
        *,
        floor: float = CoverageWeights.floor,
        known: float = CoverageWeights.known,
        collision: float = CoverageWeights.collision,
        slack: float = CoverageWeights.slack,
    ) -> None:
        RecordConstructorArgs.__init__(self, floor=floor, known=known, collision=collision, slack=slack)
        super().__init__(env)
        if not isinstance(env.unwrapped, ExploreEnv):
            raise TypeError(f"`env` must be made of ANM/Explore-v0, got {type(env.unwrapped).__name__}")
        if floor != 0.0 and not env.unwrapped.is_rewarded:
            raise ValueError(
                f"`floor` must be 0 where the environment pays for no floor, got {floor}; "
                "make it with reward='area'"
            )
        self.weights = CoverageWeights(floor, known, collision, slack)
        if known != 0.0 and not has_occupancy(env):
            raise ValueError(
                "`env` must have an occupancy grid for `known`; wrap it in OccupancyWrapper first"
            )
        self._known_m2 = self._total_m2 = 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; what the first image shows is free."""
        observation, info = self.env.reset(seed=seed, options=options)
        base = self.env.unwrapped
        assert isinstance(base, ExploreEnv)
        self._total_m2 = base.simulator.grid.component_areas_m2[0]
        self._known_m2 = self._measure_known()
        return observation, self._with_coverage(info)

    def step(self, action: np.int64) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act, and pay by the formula."""
        observation, floor_m2, terminated, truncated, info = self.env.step(action)
        known_m2 = self._measure_known()
        weights = self.weights
        gained = weights.floor * float(floor_m2) + weights.known * (known_m2 - self._known_m2)
        self._known_m2 = known_m2
        reward = gained - weights.collision * bool(info["collided"]) - weights.slack
        return observation, reward, terminated, truncated, self._with_coverage(info)

    def _measure_known(self) -> float:
        """Area of the cells that are not unknown, square metres; 0 if it is not paid for."""
        if self.weights.known == 0.0:
            return 0.0
        grid = self.get_wrapper_attr("occupancy")
        return float(grid.cell_m**2 * np.count_nonzero(~grid.unknown))

    def _with_coverage(self, info: dict[str, Any]) -> dict[str, Any]:
        if "explored_m2" not in info:
            return info
        return {**info, "coverage": info["explored_m2"] / self._total_m2}
