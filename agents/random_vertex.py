"""Exploration by random vertices of the floor's Voronoi graph: what good ways alone are worth."""

from dataclasses import dataclass, field
from typing import Final, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from anm_gym.checks import check_at_least
from anm_gym.envs.mesh_env import Observation
from anm_gym.map.voronoi_graph import VoronoiSettings, voronoi_graph
from anm_gym.wrappers.goal import Goal, GoalLimits, GoalWrapper

REASON: Final = "random vertex"


@dataclass(frozen=True)
class RandomVertexSettings:
    """When a vertex has been visited and which may be drawn."""

    limits: GoalLimits = field(
        default_factory=lambda: GoalLimits(arrival_m=0.3, timeout_steps=400, review_steps=400)
    )
    """When a goal has ended."""
    graph: VoronoiSettings = field(default_factory=VoronoiSettings)
    """The graph whose vertices are drawn."""
    failure_radius_m: float = 0.5
    """Vertices this close to one that failed are not drawn, metres."""

    def __post_init__(self) -> None:
        check_at_least(self, 0.0, "failure_radius_m")


@final
class RandomVertexGoalWrapper(GoalWrapper):
    """Turn once round, then go from one random vertex of the known floor's Voronoi graph to the next.

    See `GoalWrapper` for observation, information and needs.

    Args:
        env: An exploration environment.
        seed: Seeds the draws.
        settings: Which vertices may be drawn.

    Source:
        Active Neural Mapping at Scale, 2024, ablation "random vertex".

    Example:
        >>> import gymnasium
        >>> env = RandomVertexGoalWrapper(gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0"))
        >>> observation, info = env.reset(seed=0)
        >>> env.goal.reason
        'sweep'
    """

    def __init__(
        self,
        env: gymnasium.Env[Observation, np.int64],
        *,
        seed: int = 0,
        settings: RandomVertexSettings | None = None,
    ) -> None:
        RecordConstructorArgs.__init__(self, seed=seed, settings=settings)
        self.settings = settings or RandomVertexSettings()
        super().__init__(env, limits=self.settings.limits, seed=seed)

    def _begin_episode(self) -> None:
        self.look_round()

    def _propose_goal(self) -> Goal | None:
        graph = voronoi_graph(self.occupancy, self.position_xz, self.settings.graph)
        if graph is None:
            return None
        near = self.near_failure(graph.positions_xz, self.settings.failure_radius_m)
        goals = [Goal(position, None, REASON) for position in graph.positions_xz[~near]]
        goals = [goal for goal in goals if not self.is_reached(goal)]
        return goals[int(self.rng.integers(len(goals)))] if goals else None

    def _review_goal(self, goal: Goal) -> Goal | None:
        return goal
