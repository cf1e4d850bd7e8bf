"""UPEN's goals: the end of the path that crosses most doubt of an ensemble of occupancy predictors."""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray
from scipy import ndimage

from agents.upen_ensemble import Ensemble, load_ensemble
from agents.upen_map import PredictedMap, UpenMapSettings
from agents.upen_paths import PathSettings, candidates, node_scores
from anm_gym.checks import check_at_least, check_known, check_positive
from anm_gym.envs.mesh_env import Observation
from anm_gym.map.grid_fusion import FloorPose
from anm_gym.map.projection import OCCUPIED
from anm_gym.sim.grid_planning import RrtSettings, grow_tree
from anm_gym.wrappers.goal import Goal, GoalLimits, GoalWrapper

REASON: Final = "path"


@dataclass(frozen=True)
class UpenSettings:
    """How paths are drawn, scored and kept."""

    limits: GoalLimits = field(
        default_factory=lambda: GoalLimits(arrival_m=0.1, timeout_steps=1000, review_steps=1)
    )
    """When a goal has ended; whether it is due for another is asked at every step."""
    raster: UpenMapSettings = field(default_factory=UpenMapSettings)
    """The maps."""
    tree: RrtSettings = field(default_factory=lambda: RrtSettings(iterations=1000))
    """How paths are drawn; 2500 points over the whole map in the paper's code."""
    paths: PathSettings = field(default_factory=PathSettings)
    """How they are scored."""
    replan_steps: int | None = 10
    """Steps after which another path is chosen (paper's code, with steps of 0.25 m); None for no limit."""
    replan_m: float | None = None
    """Metres after which another path is chosen; None for no limit."""
    clearance_m: float = 0.0
    """Distance that paths keep from predicted obstacles, metres; none in the paper's code."""
    blacklist_m: float = 0.0
    """Paths that end this close to a goal that failed are left out, metres."""

    def __post_init__(self) -> None:
        if self.replan_steps is None and self.replan_m is None:
            raise ValueError("`replan_steps` or `replan_m` must be given, got neither")
        if self.replan_steps is not None:
            check_at_least(self, 1, "replan_steps")
        if self.replan_m is not None:
            check_positive(self, "replan_m")
        check_at_least(self, 0.0, "clearance_m", "blacklist_m")


PRESETS: Final = {
    "strong": UpenSettings(
        limits=GoalLimits(arrival_m=0.3, timeout_steps=300, review_steps=1),
        tree=RrtSettings(iterations=1200, extension_m=0.4, neighbour_m=0.6, window_m=6.0),
        paths=PathSettings(score="entropy", min_depth=3, max_depth=40),
        replan_steps=None,
        replan_m=4.0,
        clearance_m=0.1,
        blacklist_m=0.5,
    ),
    "paper": UpenSettings(),
    "repo": UpenSettings(
        raster=UpenMapSettings(floor=0.0),
        tree=RrtSettings(iterations=2500, sampling="whole_map"),
        paths=PathSettings(scoring="repo"),
    ),
    "metres": UpenSettings(replan_steps=None, replan_m=2.5),
}
"""`strong`: the entropy of the members' mean instead of their variance, paths of three edges and more
in the window, another one after 4 m, away from failures and from predicted walls (ours); `paper`: as
published, with points drawn near the agent, which loses no path; `repo`: with the released code's lines
beside the paths, points over the whole map and certainty for good; `metres`: `paper` with another path
after 2.5 m, as ten steps of 0.25 m are."""


@lru_cache(maxsize=1)
def shipped_ensemble() -> Ensemble:
    """Load the ensemble that comes with a checkout, once."""
    return load_ensemble()


@final
class UpenGoalWrapper(GoalWrapper):
    """Go to the end of the path that crosses most doubt.

    See `GoalWrapper` for observation, information and needs.

    Args:
        env: An exploration environment.
        preset: One of `PRESETS`.
        seed: Seeds the points that are drawn.
        settings: Effective settings instead of the preset's.
        ensemble: The predictors; by default those that come with a checkout.

    Raises:
        ValueError: If the preset is unknown.
        PolicyError: If there are no weights.

    Source:
        Georgakis et al., Uncertainty-driven planner for exploration and navigation, ICRA 2022. Where no
        path is long enough the old goal stays, as there, or the agent wanders.
    """

    def __init__(
        self,
        env: gymnasium.Env[Observation, np.int64],
        *,
        preset: str = "strong",
        seed: int = 0,
        settings: UpenSettings | None = None,
        ensemble: Ensemble | None = None,
    ) -> None:
        RecordConstructorArgs.__init__(
            self, preset=preset, seed=seed, settings=settings, ensemble=ensemble, _disable_deepcopy=True
        )
        check_known("UPEN preset", preset, PRESETS)
        self.settings = settings or PRESETS[preset]
        self._ensemble = ensemble or shipped_ensemble()
        self.predictor = self._ensemble.identity
        self._map: PredictedMap | None = None
        super().__init__(env, limits=self.settings.limits, seed=seed)

    @property
    def predicted_map(self) -> PredictedMap:
        """What was seen and what is predicted, in the current episode."""
        if self._map is None:
            raise gymnasium.error.ResetNeeded("nothing has been predicted yet; call `reset` first")
        return self._map

    def _begin_episode(self) -> None:
        x, z = self.position_xz
        start = FloorPose((float(x), float(z)), self.heading_rad)
        self._map = PredictedMap(self._ensemble, self.get_wrapper_attr("camera"), start, self.settings.raster)
        self._last_xz, self._walked_m, self._planned_steps = self.position_xz, 0.0, 0

    def _see(self, observation: Observation) -> None:
        with self.stopwatch("predict"):
            self.predicted_map.add(observation["depth"], self._pose)
        self._walked_m += float(np.linalg.norm(self.position_xz - self._last_xz))
        self._last_xz = self.position_xz
        self._planned_steps += 1

    def _propose_goal(self) -> Goal | None:
        return self._best_goal()

    def _review_goal(self, goal: Goal) -> Goal | None:
        return (self._best_goal() or goal) if self._is_due() else goal

    def _is_due(self) -> bool:
        settings = self.settings
        in_steps = settings.replan_steps is not None and self._planned_steps >= settings.replan_steps
        return in_steps or (settings.replan_m is not None and self._walked_m >= settings.replan_m)

    def _best_goal(self) -> Goal | None:
        """The end of the best path of a new tree; None if no path qualifies."""
        self._walked_m, self._planned_steps = 0.0, 0
        frame, settings = self.predicted_map.frame, self.settings
        start = ((self.position_xz - frame.origin_xz) / frame.cell_m)[::-1]
        if not frame.contains(start[None]).all():
            return None
        tree = grow_tree(self._blocked(), frame.cell_m, start, settings.tree, self.rng)
        ends = candidates(tree, settings.paths)
        places = tree.nodes[:, ::-1] * frame.cell_m + frame.origin_xz
        ends = ends[~self.near_failure(places[ends], settings.blacklist_m)]
        if len(ends) == 0:
            return None
        scores = node_scores(tree, self.predicted_map.members, settings.paths)
        return Goal(places[ends[scores[ends].argmax()]], None, REASON)

    def _blocked(self) -> NDArray[np.bool_]:
        """(rows, columns): the likeliest class is occupied, or that is too near; the unknown is not."""
        occupied = np.asarray(self.predicted_map.mean.argmax(axis=0) == OCCUPIED)
        if self.settings.clearance_m == 0.0 or not occupied.any():
            return occupied
        distance = ndimage.distance_transform_edt(~occupied)
        return np.asarray(distance * self.predicted_map.frame.cell_m <= self.settings.clearance_m)
