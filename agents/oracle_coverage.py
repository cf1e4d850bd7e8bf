"""Goals of a planner that knows the mesh: the upper bound that tables are normalised by."""

from typing import Final, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from anm_gym.envs.mesh_env import MeshEnv, Observation
from anm_gym.metrics.oracle import GoalPose, GreedyCoverage, OracleSettings
from anm_gym.metrics.table_cache import load_view_table
from anm_gym.registration import EXPLORE_STEPS
from anm_gym.scenes.scene import Scene
from anm_gym.wrappers.goal import Goal, GoalLimits, GoalWrapper

LIMITS: Final = GoalLimits(arrival_m=0.15, timeout_steps=400, review_steps=25)
"""Poses are reviewed as what is seen on the way changes what remains."""
FAILURE_RADIUS_M: Final = 0.3
"""Poses this near to one that could not be reached are given up as well, metres."""


@final
class OracleCoverageGoalWrapper(GoalWrapper):
    """Go to the poses that newly cover most of the true surface per step.

    See `GoalWrapper` for observation and information. It reads the mesh, so it is no fair rival.

    Args:
        env: An exploration environment.
        seed: Seeds the goals of last resort alone; the search draws the same for every seed, as for a bound.

    Source:
        Ours: greedy maximum coverage with travel cost.
    """

    def __init__(self, env: gymnasium.Env[Observation, np.int64], *, seed: int = 0) -> None:
        RecordConstructorArgs.__init__(self, seed=seed)
        if not isinstance(env.unwrapped, MeshEnv):
            raise TypeError(
                "`env` must be made of an environment of this suite, as the oracle reads its mesh, got "
                f"{type(env.unwrapped).__name__}"
            )
        super().__init__(env, limits=LIMITS, seed=seed)
        forward_step_m, turn_step_rad = self.step_sizes
        self.coverage = OracleSettings(forward_step_m=forward_step_m, turn_step_rad=turn_step_rad)
        self._scene: Scene | None = None

    @property
    def covered_pct(self) -> float:
        """Share of the surface that can be seen which the frames of the episode covered, per cent."""
        if self._scene is None:
            raise gymnasium.error.ResetNeeded("nothing is covered yet; call `reset` first")
        return self._planner.covered_pct

    def _begin_episode(self) -> None:
        env = self.env.unwrapped
        assert isinstance(env, MeshEnv)
        if env.scene is not self._scene:
            self._scene = env.scene
            table = load_view_table(env.scene.storey_mesh, env.simulator)
            self._planner = GreedyCoverage(
                table, env.simulator.grid, self.coverage, horizon_steps=self._horizon_steps()
            )
        self._planner.reset()
        self._target: GoalPose | None = None
        self._num_failures = 0

    def _horizon_steps(self) -> int:
        """Tours reach to the end of the episode, where it has one; no setting, as rows name the budget."""
        budget = None if self.env.spec is None else self.env.spec.max_episode_steps
        return EXPLORE_STEPS if budget is None else budget

    def _see(self, observation: Observation) -> None:
        with self.stopwatch("goal"):
            self._planner.mark_seen(
                observation["depth"], self.get_wrapper_attr("camera"), observation["world_from_camera"]
            )

    def _propose_goal(self) -> Goal | None:
        if self._target is not None:
            has_failed = len(self.failures) > self._num_failures
            self._planner.give_up(self._target, FAILURE_RADIUS_M if has_failed else 0.0)
        self._num_failures = len(self.failures)
        return self._best_goal()

    def _review_goal(self, goal: Goal) -> Goal | None:
        before = self._target
        best = self._best_goal()
        is_same = before is not None and self._target is not None and _names(before) == _names(self._target)
        return goal if is_same else best

    def _best_goal(self) -> Goal | None:
        self._target = self._planner.next_goal(self.position_xz, self.heading_rad)
        if self._target is None:
            return None
        return Goal(self._target.position_xz, self._target.heading_rad, "coverage")


def _names(pose: GoalPose) -> tuple[int, int]:
    """Place of a pose in the view table."""
    return pose.position_index, pose.heading_index
