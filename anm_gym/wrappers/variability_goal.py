"""Goals from neural variability: look where the map's own prediction is unstable."""

from typing import Final, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from anm_gym.checks import check_at_least, check_known
from anm_gym.envs.mesh_env import Observation
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.targets import (
    PAPER_TARGETS,
    RELEASED_TARGETS,
    TargetSettings,
    TargetView,
    choose_target_view,
    propose_target_views,
)
from anm_gym.map.view_planner import PlannerSettings, ViewPlanner
from anm_gym.map.views import View
from anm_gym.wrappers.goal import Goal, GoalLimits, GoalWrapper

CLUSTER_PRESETS: Final = {"paper": PAPER_TARGETS, "released": RELEASED_TARGETS}
"""Presets that go to a cluster of variable zero-crossings."""
VIEW_PRESETS: Final = ("best", "fast")
"""Presets that plan the next best view."""
CLUSTER_LIMITS: Final = GoalLimits(arrival_m=0.8, timeout_steps=100, review_steps=1000)
"""The released code replaces a goal within 0.8 m or after 100 steps."""
VIEW_LIMITS: Final = GoalLimits(arrival_m=0.3, timeout_steps=250, review_steps=10)
"""Ours."""
FAILURE_RADIUS_M: Final = 0.5
"""Target views this close to one that failed are not proposed again, metres."""
MAX_FAILURES: Final = 20
"""So many of the latest failures are remembered."""


@final
class VariabilityGoalWrapper(GoalWrapper):
    """Propose views of surface whose predicted distance changes most under weight perturbation.

    See `GoalWrapper` for observation and information.

    ## Needs
    A `NeuralMapWrapper` below it.

    Args:
        env: An environment under a `NeuralMapWrapper`.
        preset: `paper` and `released` go to a cluster of variable zero-crossings, `best` and `fast`
            plan the next best view. What follows a "+" concerns the map alone.
        seed: Seeds what is drawn.
        targets: Effective cluster settings instead of the preset's.
        planning: Effective settings of the view planner instead of the preset's.

    Raises:
        ValueError: If the preset is unknown or there is no neural map below.

    Source:
        Active Neural Mapping, Sec. 4.2; the view planner is ours.

    Example:
        >>> import gymnasium
        >>> from anm_gym.wrappers.neural_map import NeuralMapWrapper
        >>> env = gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0")
        >>> env = VariabilityGoalWrapper(NeuralMapWrapper(env, preset="fast"), preset="fast")
        >>> observation, info = env.reset(seed=0)
        >>> observation["pointgoal_with_gps_compass"].shape
        (2,)
    """

    def __init__(
        self,
        env: gymnasium.Env[Observation, np.int64],
        *,
        preset: str = "best",
        seed: int = 0,
        targets: TargetSettings | None = None,
        planning: PlannerSettings | None = None,
    ) -> None:
        RecordConstructorArgs.__init__(self, preset=preset, seed=seed, targets=targets, planning=planning)
        choices = [*CLUSTER_PRESETS, *VIEW_PRESETS]
        base = preset.partition("+")[0]
        check_known("goal preset", base, choices)
        if not env.has_wrapper_attr("neural_map"):
            raise ValueError("`env` must have a neural map; wrap it in NeuralMapWrapper first")
        self.targets = targets or CLUSTER_PRESETS.get(base)
        if self.targets and planning is not None:
            raise ValueError(
                "`planning` must be None where goals are chosen among clusters, got settings; "
                f"choose preset {' or '.join(VIEW_PRESETS)}"
            )
        self.planning = planning or PlannerSettings()
        limits = CLUSTER_LIMITS if self.targets else VIEW_LIMITS
        if not self.targets:
            check_at_least(self.planning, limits.arrival_m, "taken_radius_m")
        super().__init__(env, limits=limits, seed=seed)

    def _begin_episode(self) -> None:
        self._view: View | None = None
        self._proposed: tuple[int, list[TargetView]] | None = None
        self._planner = ViewPlanner(self.planning.for_steps(*self.step_sizes))

    def _see(self, observation: Observation) -> None:  # noqa: ARG002
        self._planner.note_view(self.position_xz, self.heading_rad)

    def _propose_goal(self) -> Goal | None:
        return self._cluster_goal() if self.targets else self._view_goal(None)

    def _review_goal(self, goal: Goal) -> Goal | None:
        if self.targets:
            return goal
        if goal.reason != "view":
            return self._view_goal(None) or goal
        current = self._view
        reviewed = self._view_goal(current)
        return goal if self._view is current else reviewed

    def _view_goal(self, current: View | None) -> Goal | None:
        """Plan the next best view."""
        view = self._planner.plan(
            self._neural_map,
            self.position_xz,
            self.heading_rad,
            self.rng,
            current=current,
            excluded_xz=self._failed_xz(),
        )
        self._view = view
        return None if view is None else Goal(view.position_xz, view.heading_rad, "view")

    def _cluster_goal(self) -> Goal | None:
        """Go to the cluster of variable zero-crossings that the criterion chooses."""
        assert self.targets is not None
        views = self._target_views(self.targets)
        near = self.near_failure([view.position[[0, 2]] for view in views], FAILURE_RADIUS_M, MAX_FAILURES)
        views = [view for view, is_near in zip(views, near, strict=True) if not is_near]
        chosen = choose_target_view(views, self._neural_map, self._pose[:3, 3], self._visible(), self.targets)
        return None if chosen is None else Goal(chosen.position[[0, 2]], None, "cluster")

    def _target_views(self, targets: TargetSettings) -> list[TargetView]:
        """Those of the map as it is; it does not change while goals fail within a step."""
        num_frames = self._neural_map.num_frames
        if self._proposed is None or self._proposed[0] != num_frames:
            self._proposed = num_frames, propose_target_views(self._neural_map, targets)
        return self._proposed[1]

    def _visible(self) -> NDArray[np.float32]:
        """(N, 3) points that the camera sees now."""
        neural_map = self._neural_map
        return neural_map.frames.points(len(neural_map.frames) - 1, stride=4).cpu().numpy()

    def _failed_xz(self) -> NDArray[np.float64]:
        """(N, 2) places of the latest goals that failed."""
        return np.array([goal.position_xz for goal in self.failures[-MAX_FAILURES:]]).reshape(-1, 2)

    @property
    def _neural_map(self) -> NeuralMap:
        neural_map = self.env.get_wrapper_attr("neural_map")
        assert isinstance(neural_map, NeuralMap)
        return neural_map
