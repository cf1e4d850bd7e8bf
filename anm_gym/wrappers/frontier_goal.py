"""Frontier-based exploration as a source of goals."""

from dataclasses import dataclass
from typing import Final, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from anm_gym.envs.mesh_env import Observation
from anm_gym.map.frontier import Frontier, find_frontiers
from anm_gym.map.reach import ReachableSpace, ReachSettings, reachable_space
from anm_gym.wrappers.goal import Goal, GoalLimits, GoalWrapper


@dataclass(frozen=True)
class FrontierSettings:
    """How frontiers are filtered and chosen."""

    min_size_m: float
    """Shorter frontiers are ignored, metres."""
    min_distance_m: float
    """The nearest frontier at least this far is chosen; farther ones only if there is none, metres."""
    only_reachable: bool
    """Rank by the length of the path and ignore what cannot be reached; else by straight distance."""
    blacklist_m: float
    """Frontiers this close to a goal that failed are ignored, metres; 0 keeps all."""
    look_outward: bool
    """Look into the unknown on arrival."""
    switch_share: float
    """A review changes the goal only for one that is cheaper by this factor."""
    limits: GoalLimits
    """When a goal has ended."""


PRESETS: Final = {
    "paper": FrontierSettings(
        min_size_m=0.0,
        min_distance_m=1.0,
        only_reachable=False,
        blacklist_m=0.0,
        look_outward=False,
        switch_share=1.0,
        limits=GoalLimits(arrival_m=0.2, timeout_steps=1000, review_steps=10),
    ),
    "strong": FrontierSettings(
        min_size_m=0.4,
        min_distance_m=0.0,
        only_reachable=True,
        blacklist_m=0.5,
        look_outward=True,
        switch_share=0.7,
        limits=GoalLimits(arrival_m=0.3, timeout_steps=250, review_steps=5),
    ),
}
"""`paper`: nearest frontier at least 1 m away, replanned every 10 steps, as the paper's baseline is
run; `strong`: the nearest by path of those that can be reached, with a memory of failures (ours)."""


@final
class FrontierGoalWrapper(GoalWrapper):
    """Go to the nearest frontier between free and unknown floor.

    See `GoalWrapper` for observation, information and needs.

    Args:
        env: An exploration environment.
        preset: One of `PRESETS`.
        seed: Seeds the fallback goals.

    Raises:
        ValueError: If the preset is unknown.

    Source:
        Yamauchi, 1997; the baseline FBE of Active Neural Mapping, Table 1.

    Example:
        >>> import gymnasium
        >>> env = FrontierGoalWrapper(gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0"))
        >>> observation, info = env.reset(seed=0)
        >>> observation["pointgoal_with_gps_compass"].shape
        (2,)
    """

    def __init__(
        self, env: gymnasium.Env[Observation, np.int64], preset: str = "strong", seed: int = 0
    ) -> None:
        RecordConstructorArgs.__init__(self, preset=preset, seed=seed)
        if preset not in PRESETS:
            raise ValueError(f"unknown frontier preset {preset!r}; choose one of: {', '.join(sorted(PRESETS))}")
        self.settings = PRESETS[preset]
        super().__init__(env, limits=self.settings.limits, seed=seed)

    def _begin_episode(self) -> None:
        pass

    def _propose_goal(self) -> Goal | None:
        ranked = self._ranked()
        return ranked[0][1] if ranked else None

    def _review_goal(self, goal: Goal) -> Goal | None:
        settings = self.settings
        ranked = self._ranked()
        if not ranked:
            return goal
        best_cost, best = ranked[0]
        same = [cost for cost, other in ranked if np.linalg.norm(other.position_xz - goal.position_xz) < 0.75]
        if goal.reason == "frontier" and same and best_cost > settings.switch_share * min(same):
            return goal
        return best

    def _ranked(self) -> list[tuple[float, Goal]]:
        """Every frontier that qualifies with its cost, cheapest first."""
        settings, grid = self.settings, self.occupancy
        space = reachable_space(grid, self.position_xz, ReachSettings()) if settings.only_reachable else None
        frontiers = find_frontiers(grid.free, grid.unknown, grid.frame, settings.min_size_m)
        ranked: list[tuple[float, Goal]] = []
        for frontier in frontiers:
            cost = self._cost(frontier, space)
            if np.isfinite(cost) and not self._has_failed(frontier):
                heading = frontier.outward_rad if settings.look_outward else None
                ranked.append((cost, Goal(frontier.center_xz, heading, "frontier")))
        ranked.sort(key=lambda pair: (pair[0] < settings.min_distance_m, abs(pair[0])))
        return ranked

    def _cost(self, frontier: Frontier, space: ReachableSpace | None) -> float:
        if not self.settings.only_reachable:
            return float(np.linalg.norm(frontier.center_xz - self.position_xz))
        return float("inf") if space is None else space.cost_to(frontier.center_xz, tolerance_m=0.3)

    def _has_failed(self, frontier: Frontier) -> bool:
        return any(
            np.linalg.norm(frontier.center_xz - goal.position_xz) < self.settings.blacklist_m
            for goal in self.failures
        )


