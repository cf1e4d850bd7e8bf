"""Receding-horizon next-best-view exploration: grow a tree of views, follow its best branch for one edge."""

from dataclasses import dataclass, field, replace
from typing import Final, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from agents.nbv import REASON, UnseenViews
from agents.view_tree import Look, LookSettings, ViewTree, best_looks, grow_view_tree
from anm_gym.checks import check_at_least, check_known
from anm_gym.envs.mesh_env import Observation
from anm_gym.map.reach import ReachableSpace, ReachSettings, reachable_space
from anm_gym.map.unseen_volume import UnseenSettings
from anm_gym.map.views import TakenViews, sector_of
from anm_gym.sim.grid_planning import RrtSettings
from anm_gym.wrappers.goal import Goal, GoalLimits, GoalWrapper

WAY_REASON: Final = "on the way"
"""Reason of a goal that is passed on the way to a view."""
LIMITS: Final = GoalLimits(arrival_m=0.2, timeout_steps=250, review_steps=10)
"""Ours; an edge is short, but the way to where a former branch comes in sight need not be."""
TREE: Final = RrtSettings(
    iterations=150, extension_m=1.0, neighbour_m=1.0, shrink_m=10.0, sampling="whole_map"
)
"""Edges of the released configuration, more points (ours)."""


@dataclass(frozen=True)
class RhNbvSettings:
    """How the tree grows and when it is grown anew."""

    limits: GoalLimits = LIMITS
    """When a goal has ended."""
    unseen: UnseenSettings = field(default_factory=UnseenSettings)
    """What a view would show."""
    reach: ReachSettings = field(default_factory=ReachSettings)
    """What counts as passable."""
    looks: LookSettings = field(default_factory=LookSettings)
    """What a look is worth."""
    tree: RrtSettings = TREE
    """How the tree grows."""
    max_iterations: int = 600
    """Points drawn at most: the tree is grown larger while no look shows anything."""
    review_share: float = 0.3
    """A branch that shows less than this share of what it promised is given up."""

    def __post_init__(self) -> None:
        check_at_least(self, self.tree.iterations, "max_iterations")
        check_at_least(self, 0.0, "review_share")


PRESETS: Final = {
    "strong": RhNbvSettings(),
    "paper": RhNbvSettings(
        unseen=UnseenSettings(range_m=1.5, decay_m=float("inf")),
        looks=LookSettings(
            decay_per_m=0.5,
            look_cost_m=0.0,
            min_gain_m3=0.0,
            every_node=True,
            shares_views=False,
            counts_turns=False,
        ),
        tree=replace(TREE, iterations=30),
        max_iterations=200,
        review_share=0.0,
    ),
}
"""`paper`: range, decay and sizes of the released configuration, headings drawn; `strong`: sees farther,
chooses where to look, counts turns, and looks again at a branch under way (ours)."""


@final
class RhNbvGoalWrapper(GoalWrapper):
    """Follow the best branch of a random tree of views for one edge, then grow it anew.

    See `GoalWrapper` for observation, information and needs.

    Args:
        env: An exploration environment.
        preset: One of `PRESETS`.
        seed: Seeds the tree.
        settings: Effective settings instead of the preset's.

    Raises:
        ValueError: If the preset is unknown.

    Source:
        Bircher et al., Receding Horizon "Next-Best-View" Planner for 3D Exploration, 2016.

    Example:
        >>> import gymnasium
        >>> env = RhNbvGoalWrapper(gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0"))
        >>> observation, info = env.reset(seed=0)
        >>> env.goal.reason
        'view'
    """

    def __init__(
        self,
        env: gymnasium.Env[Observation, np.int64],
        *,
        preset: str = "strong",
        seed: int = 0,
        settings: RhNbvSettings | None = None,
    ) -> None:
        RecordConstructorArgs.__init__(self, preset=preset, seed=seed, settings=settings)
        check_known("RH-NBV preset", preset, PRESETS)
        self.settings = settings or PRESETS[preset]
        super().__init__(env, limits=self.settings.limits, seed=seed)

    def _begin_episode(self) -> None:
        self._views = UnseenViews(self, self.settings.unseen)
        self._taken = TakenViews(self.arrival_m, self.arrival_rad)
        self._branch: list[NDArray[np.float64]] = []
        self._looks: list[tuple[NDArray[np.float64], float]] = []
        self._promised_m3 = 0.0

    def _see(self, observation: Observation) -> None:
        with self.stopwatch("goal"):
            self._views.add(observation)
            self._taken.add(self.position_xz, self.heading_rad)

    def _propose_goal(self) -> Goal | None:
        space = reachable_space(self.occupancy, self.position_xz, self.settings.reach)
        if space is None:
            return None
        has_failed = (
            bool(self.failures and self.goals) and self.failures[-1].position_xz is self.goal.position_xz
        )
        tree, looks = self._best_looks(space, [] if has_failed else self._branch)
        headings = {look.node: look.heading_rad for look in looks}
        way = tree.way_to(looks[-1].node) if looks else []
        self._looks = [(tree.positions_xz[node], heading) for node, heading in headings.items()]
        self._branch = [tree.positions_xz[node] for node in way[1:]]
        self._promised_m3 = self._shown_m3()
        stops = [
            Goal(tree.positions_xz[node], headings.get(node), REASON if node in headings else WAY_REASON)
            for node in way
        ]
        return next((stop for stop in stops if not self.is_reached(stop)), None)

    def _review_goal(self, goal: Goal) -> Goal | None:
        if goal.reason not in {REASON, WAY_REASON}:
            return self._propose_goal() or goal
        least_m3 = self.settings.review_share * self._promised_m3
        return goal if least_m3 <= 0.0 or self._shown_m3() >= least_m3 else None

    def _best_looks(
        self, space: ReachableSpace, old_branch: list[NDArray[np.float64]]
    ) -> tuple[ViewTree, list[Look]]:
        """Grow a tree, and a larger one until some sequence of looks shows something."""
        worth = replace(self.settings.looks, turn_cost_m=self.turn_cost_m)
        growth = self.settings.tree
        while True:
            tree = grow_view_tree(space, self.position_xz, old_branch, growth, self.rng)
            unseen = self._views.by_cell(tree.positions_xz)
            unseen.share[self._taken.among(tree.positions_xz, unseen.share.shape[1])] = 0.0
            looks = best_looks(tree, unseen, self.heading_rad, worth, self.rng)
            if looks or growth.iterations >= self.settings.max_iterations:
                return tree, looks
            growth = replace(growth, iterations=min(2 * growth.iterations, self.settings.max_iterations))

    def _shown_m3(self) -> float:
        """What the looks ahead would show now, cubic metres."""
        if not self._looks:
            return 0.0
        gains = self._views.gains(np.array([place for place, _ in self._looks]))
        sectors = [sector_of(heading, gains.shape[1]) for _, heading in self._looks]
        return float(gains[np.arange(len(gains)), sectors].sum())
