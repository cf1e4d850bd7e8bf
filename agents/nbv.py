"""Greedy next-best-view exploration: go where a view would show the most unseen space for its cost."""

from dataclasses import dataclass, field
from typing import Final, Literal, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from anm_gym.checks import check_at_least, check_choices, check_known
from anm_gym.envs.mesh_env import Observation
from anm_gym.map.reach import ReachableSpace, ReachSettings, reachable_space
from anm_gym.map.unseen_volume import UnseenByCell, UnseenSettings, unseen_by_cell, unseen_volume
from anm_gym.map.views import TakenViews, View, ViewSettings, rank_views, sector_of, view_costs
from anm_gym.map.volume import ObservedVolume
from anm_gym.wrappers.goal import Goal, GoalLimits, GoalWrapper

Utility = Literal["rate", "exponential"]
REASON: Final = "view"


LIMITS: Final = GoalLimits(arrival_m=0.3, timeout_steps=250, review_steps=10)
"""Those of the view planner on the neural map."""


@dataclass(frozen=True)
class NbvSettings:
    """How views are sampled and weighed."""

    limits: GoalLimits = LIMITS
    """When a goal has ended."""
    unseen: UnseenSettings = field(default_factory=UnseenSettings)
    """What a view would show."""
    reach: ReachSettings = field(default_factory=ReachSettings)
    """What counts as passable."""
    num_places: int = 80
    """Places drawn from the reachable floor."""
    utility: Utility = "rate"
    """`rate`: gain per step; `exponential`: gain times exp(-decay * cost)."""
    fixed_cost_steps: float = 18.0
    """Added to the cost of each view, steps (`rate`)."""
    decay_per_m: float = 0.5
    """Decay of the gain with the cost as a length, 1/m (`exponential`)."""
    min_gain_m3: float = 0.05
    """Views that show less are not worth a way, cubic metres."""
    keep_share: float = 0.8
    """A view under way is kept while it has this share of the best one's utility."""
    failure_radius_m: float = 0.4
    """Places this close to one that failed are left out, metres."""

    def __post_init__(self) -> None:
        check_choices(self)
        check_at_least(self, 1, "num_places")
        check_at_least(self, 0.0, "fixed_cost_steps", "decay_per_m", "min_gain_m3")
        check_at_least(self, 0.0, "keep_share", "failure_radius_m")


PRESETS: Final = {
    "strong": NbvSettings(),
    "exponential": NbvSettings(
        unseen=UnseenSettings(decay_m=float("inf")), utility="exponential", keep_share=1.0
    ),
}
"""`strong`: hope decays in unknown space and a view is worth its gain per step (ours); `exponential`: all
unknown voxels in sight count, discounted by the length of the way, as the literature has it."""


class UnseenViews:
    """What an episode's frames have shown, and what other views would add.

    Args:
        env: The wrapper whose agent sees.
        settings: Which rays are cast.
    """

    def __init__(self, env: GoalWrapper, settings: UnseenSettings) -> None:
        self._env, self.settings = env, settings
        self.camera = env.get_wrapper_attr("camera")
        self.volume = ObservedVolume(self.camera)

    def add(self, observation: Observation) -> None:
        """Log a frame."""
        self.volume.integrate(observation["depth"], observation["world_from_camera"])

    def gains(self, positions_xz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Unseen volume in view, (P, H) cubic metres, of (P, 2) places and all headings."""
        floor_y_m, centers = self._centers(positions_xz)
        return unseen_volume(self.volume, centers, floor_y_m, self.camera, self.settings)

    def by_cell(self, positions_xz: NDArray[np.float64]) -> UnseenByCell:
        """Where the unseen volume lies that (P, 2) places would show."""
        floor_y_m, centers = self._centers(positions_xz)
        return unseen_by_cell(self.volume, centers, floor_y_m, self.camera, self.settings)

    def _centers(self, positions_xz: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        floor_y_m = self._env.occupancy.floor_y_m
        return floor_y_m, np.insert(positions_xz, 1, floor_y_m + self.camera.sensor_height_m, axis=1)


@final
class NbvGoalWrapper(GoalWrapper):
    """Go to the sampled view that shows the most unseen volume for its cost.

    See `GoalWrapper` for observation, information and needs.

    Args:
        env: An exploration environment.
        preset: One of `PRESETS`.
        seed: Seeds the places that are drawn.
        settings: Effective settings instead of the preset's.

    Raises:
        ValueError: If the preset is unknown.

    Source:
        González-Baños and Latombe, Navigation strategies for exploring indoor environments, 2002
        (gain times exp(-decay * length)), with voxels instead of polygons; `rate` is ours.

    Example:
        >>> import gymnasium
        >>> env = NbvGoalWrapper(gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0"))
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
        settings: NbvSettings | None = None,
    ) -> None:
        RecordConstructorArgs.__init__(self, preset=preset, seed=seed, settings=settings)
        check_known("NBV preset", preset, PRESETS)
        self.settings = settings or PRESETS[preset]
        super().__init__(env, limits=self.settings.limits, seed=seed)

    def _begin_episode(self) -> None:
        self._views = UnseenViews(self, self.settings.unseen)
        self._taken = TakenViews(self.arrival_m, self.arrival_rad)
        self._view: View | None = None

    def _see(self, observation: Observation) -> None:
        with self.stopwatch("goal"):
            self._views.add(observation)
            self._taken.add(self.position_xz, self.heading_rad)

    def _propose_goal(self) -> Goal | None:
        self._view = None
        return self._plan(None)

    def _review_goal(self, goal: Goal) -> Goal | None:
        planned = self._plan(goal)
        return planned if goal.reason == REASON else planned or goal

    def _plan(self, under_way: Goal | None) -> Goal | None:
        """Choose among drawn places, the agent's own and, first, that of the last view that was chosen.

        Args:
            under_way: The goal to keep while that view still serves; None before it has been chosen.

        Returns:
            The goal under way, or that of a better view; None if no view is worth a way.
        """
        settings, current = self.settings, self._view
        space = reachable_space(self.occupancy, self.position_xz, settings.reach)
        positions, lengths_m = self._places(space, current)
        gains = self._views.gains(positions)
        gains[(gains < settings.min_gain_m3) | self._taken.among(positions, gains.shape[1])] = 0.0
        best, utilities = self._rank(positions, lengths_m, gains)
        if best.utility <= 0.0:
            self._view = None
            return None
        if current is not None:
            sector = sector_of(current.heading_rad, gains.shape[1])
            if utilities[0, sector] >= settings.keep_share * utilities.max():
                return under_way
        self._view = best
        return Goal(best.position_xz, best.heading_rad, REASON)

    def _places(
        self, space: ReachableSpace | None, current: View | None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(P, 2) floor points and (P,) the cost of the way to each, metres."""
        first = [self.position_xz] if current is None else [current.position_xz, self.position_xz]
        if space is None:
            return np.array(first), np.zeros(len(first))
        cells = np.argwhere(space.reachable)
        if len(cells) > self.settings.num_places:
            cells = cells[self.rng.choice(len(cells), self.settings.num_places, replace=False)]
        positions, costs = space.frame.centers_of(cells), space.cost_m[cells[:, 0], cells[:, 1]]
        far = ~self.near_failure(positions, self.settings.failure_radius_m)
        positions, costs = positions[far], costs[far]
        first_costs = [space.cost_to(place, 0.4) for place in first[:-1]] + [0.0]
        return np.concatenate([first, positions]), np.concatenate([first_costs, costs])

    def _rank(
        self, positions: NDArray[np.float64], lengths_m: NDArray[np.float64], gains: NDArray[np.float64]
    ) -> tuple[View, NDArray[np.float64]]:
        """The best view and the (P, H) utilities of all."""
        settings = self.settings
        forward_step_m, turn_step_rad = self.step_sizes
        ranking = ViewSettings(
            num_headings=gains.shape[1],
            fixed_cost_steps=settings.fixed_cost_steps,
            forward_step_m=forward_step_m,
            turn_step_rad=turn_step_rad,
        )
        costs = view_costs(positions, lengths_m, self.position_xz, self.heading_rad, ranking)
        if settings.utility == "exponential":
            gains = gains * np.exp(-settings.decay_per_m * lengths_m)[:, None]
            return rank_views(positions, gains, np.zeros_like(costs), ranking)
        return rank_views(positions, gains, costs, ranking)
