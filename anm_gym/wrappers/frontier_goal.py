"""Frontier-based exploration as a source of goals."""

from dataclasses import dataclass
from typing import Any, Final, Literal, Protocol, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from anm_gym.checks import check_at_least, check_choices, check_known, check_positive
from anm_gym.envs.mesh_env import Observation
from anm_gym.geometry import heading_towards, wrap_angle
from anm_gym.map.frontier import Frontier, find_frontiers
from anm_gym.map.reach import reachable_space
from anm_gym.sim.geodesic import GridGraph, nearest_free_cell
from anm_gym.sim.grid import GridFrame
from anm_gym.wrappers.goal import Goal, GoalLimits, GoalWrapper

SAME_M: Final = 0.75
"""Goals this close to each other are at the same frontier, metres."""


@dataclass(frozen=True)
class FrontierSettings:
    """How frontiers are filtered and chosen."""

    limits: GoalLimits
    """When a goal has ended."""
    min_size_m: float = 0.0
    """Shorter frontiers are ignored, metres."""
    max_size_m: float = float("inf")
    """Longer frontiers are cut into parts, metres."""
    min_distance_m: float = 0.0
    """The nearest frontier at least this far is chosen; if there is none, the farthest, metres."""
    only_reachable: bool = False
    """Rank by the cost of a way that the body fits through; else by a path of the free cells alone."""
    blacklist_m: float = 0.0
    """Frontiers this close to a goal that failed are ignored, metres; 0 keeps all."""
    looks_outward: bool = False
    """Look into the unknown on arrival."""
    switch_share: float = 1.0
    """A goal under way is dropped only for one that costs less than this share of it."""
    sweeps: bool = False
    """Turn once round at the start."""
    map_source: Literal["observed", "predicted"] = "observed"
    """Where frontiers are searched: in what was seen, or in the map of the `source` that is handed over."""

    def __post_init__(self) -> None:
        check_choices(self)
        check_at_least(self, 0.0, "min_size_m", "min_distance_m", "blacklist_m", "switch_share")
        check_positive(self, "max_size_m")
        if self.map_source == "predicted" and self.only_reachable:
            raise ValueError("`only_reachable` must be False with `map_source` predicted, got True")


PRESETS: Final = {
    "paper": FrontierSettings(
        limits=GoalLimits(arrival_m=0.1, timeout_steps=1000, review_steps=10), min_distance_m=1.0
    ),
    "strong": FrontierSettings(
        limits=GoalLimits(arrival_m=0.3, timeout_steps=600, review_steps=5),
        min_size_m=0.4,
        max_size_m=2.0,
        only_reachable=True,
        blacklist_m=0.5,
        looks_outward=True,
        switch_share=0.7,
        sweeps=True,
    ),
    "upen-repo": FrontierSettings(
        limits=GoalLimits(arrival_m=0.1, timeout_steps=1000, review_steps=10),
        min_distance_m=1.0,
        map_source="predicted",
    ),
}
"""`paper`: the nearest frontier at least 1 m away, replanned every 10 steps, whether or not the body can
get there, as published baselines run it; `strong`: the nearest by path of those that can be reached,
kept until another is clearly nearer, with a memory of failures (ours); `upen-repo`: `paper` in a predicted
map, as UPEN's released code runs its baseline."""


class FloorSource(Protocol):
    """A map that is searched for frontiers instead of the wrapper's own."""

    @property
    def identity(self) -> Any:
        """What tells the source from others, a frozen dataclass for the settings of a row."""

    def begin(self, env: GoalWrapper) -> None:
        """Forget the last episode; the wrapper knows the pose of the new one."""

    def see(self, observation: Observation) -> None:
        """Take an observation in, the first one too."""

    def floor(self) -> tuple[GridFrame, NDArray[np.bool_], NDArray[np.bool_]]:
        """Where the cells lie, and which are free and unknown."""


@final
class FrontierGoalWrapper(GoalWrapper):
    """Go to the nearest frontier between free and unknown floor.

    See `GoalWrapper` for observation, information and needs.

    Args:
        env: An exploration environment.
        preset: One of `PRESETS`.
        seed: Seeds what is drawn.
        settings: Effective settings instead of the preset's.
        source: The map that is searched where the settings say `predicted`. It belongs to this episode's
            environment alone, so `spec` does not hold it.

    Raises:
        ValueError: If the preset is unknown, or a source is missing or not asked for.

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
        self,
        env: gymnasium.Env[Observation, np.int64],
        *,
        preset: str = "strong",
        seed: int = 0,
        settings: FrontierSettings | None = None,
        source: FloorSource | None = None,
    ) -> None:
        RecordConstructorArgs.__init__(self, preset=preset, seed=seed, settings=settings)
        check_known("frontier preset", preset, PRESETS)
        self.settings = settings or PRESETS[preset]
        if (source is not None) != (self.settings.map_source == "predicted"):
            raise ValueError(f"`source` must be given for a predicted map and for no other, got {source}")
        self._source = source
        self.map_identity: Any = None if source is None else source.identity
        super().__init__(env, limits=self.settings.limits, seed=seed)

    def _begin_episode(self) -> None:
        if self._source is not None:
            self._source.begin(self)
        if self.settings.sweeps:
            self.look_round()

    def _see(self, observation: Observation) -> None:
        if self._source is not None:
            with self.stopwatch("predict"):
                self._source.see(observation)

    def _propose_goal(self) -> Goal | None:
        ranked = self._ranked()
        return ranked[0][1] if ranked else None

    def _review_goal(self, goal: Goal) -> Goal | None:
        ranked = self._ranked()
        if not ranked:
            return goal if goal.reason != "frontier" else None
        best_cost, best = ranked[0]
        same = [
            cost for cost, other in ranked if np.linalg.norm(other.position_xz - goal.position_xz) < SAME_M
        ]
        if goal.reason == "frontier" and same and best_cost >= self.settings.switch_share * min(same):
            return goal
        return best

    def _ranked(self) -> list[tuple[float, Goal]]:
        """Every frontier that qualifies with its cost, the best first."""
        settings = self.settings
        frame, free, unknown = self._floor()
        frontiers = find_frontiers(free, unknown, frame, settings.min_size_m, settings.max_size_m)
        is_by_way = settings.only_reachable
        ranked = self._by_way(frontiers) if is_by_way else self._by_free_path(frontiers, frame, free)
        failed = self.near_failure([goal.position_xz for _, goal in ranked], settings.blacklist_m)
        ranked = [
            pair for pair, near in zip(ranked, failed, strict=True) if np.isfinite(pair[0]) and not near
        ]
        ranked.sort(key=lambda pair: pair[0])
        far = [pair for pair in ranked if self._distance_m(pair[1]) >= settings.min_distance_m]
        return far or ranked[::-1]

    def _by_way(self, frontiers: list[Frontier]) -> list[tuple[float, Goal]]:
        """Cost of the way to the middle of each frontier, the first turn included."""
        space = reachable_space(self.occupancy, self.position_xz)
        if space is None:
            return []
        ranked, turn_cost_m = [], self.turn_cost_m
        for frontier in frontiers:
            turn_rad = wrap_angle(heading_towards(self.position_xz, frontier.center_xz) - self.heading_rad)
            cost = space.cost_to(frontier.center_xz, tolerance_m=0.3) + turn_cost_m * abs(turn_rad)
            heading = frontier.outward_rad if self.settings.looks_outward else None
            goal = Goal(frontier.center_xz, heading, "frontier")
            ranked.append((cost, goal))
        return ranked

    def _floor(self) -> tuple[GridFrame, NDArray[np.bool_], NDArray[np.bool_]]:
        """Where the cells lie, and which are free and unknown."""
        if self._source is not None:
            return self._source.floor()
        return self.occupancy.frame, self.occupancy.free, self.occupancy.unknown

    def _by_free_path(
        self, frontiers: list[Frontier], frame: GridFrame, free: NDArray[np.bool_]
    ) -> list[tuple[float, Goal]]:
        """Length of a path of free cells to the nearest cell of each frontier."""
        start = nearest_free_cell(free, frame.cells_of(self.position_xz)[0], 20)
        if start is None:
            return []
        distance_m = GridGraph(free, frame.cell_m).distance_from(start)
        ranked = []
        for frontier in frontiers:
            lengths = distance_m[frontier.cells[:, 0], frontier.cells[:, 1]]
            nearest = frontier.cells[int(lengths.argmin())]
            ranked.append((float(lengths.min()), Goal(frame.centers_of(nearest)[0], None, "frontier")))
        return ranked

    def _distance_m(self, goal: Goal) -> float:
        return float(np.linalg.norm(goal.position_xz - self.position_xz))
