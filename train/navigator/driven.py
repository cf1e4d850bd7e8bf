"""Point-goal episodes of navigators that drive an environment under a goal wrapper, one by one."""

import time
from typing import Any, Final, final

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from agents.navigators import make_navigator
from anm_gym.actions import Action
from anm_gym.envs.mesh_env import Observation
from anm_gym.envs.pointnav import PointNavEnv
from anm_gym.wrappers.goal import Goal, GoalLimits, GoalWrapper
from train.navigator.env import step_limit
from train.navigator.episodes import RESULTS, NavigationEpisode, make_pointnav

ARRIVAL_M: Final = 0.18
"""Nearer than this to its goal an agent stops, metres; it succeeds within 0.2 m."""
MAX_FAILURES: Final = 5
"""Times that a navigator may give the goal up before the episode ends where it is."""


@final
class PointGoalSeat(GoalWrapper):
    """The goal of a point-goal environment, for navigators that know goal wrappers only.

    See `GoalWrapper` for observation and information.

    Args:
        env: `ANM/PointNav-v0`.
    """

    def __init__(self, env: gymnasium.Env[Observation, np.int64]) -> None:
        RecordConstructorArgs.__init__(self)
        endless = np.iinfo(np.int64).max
        limits = GoalLimits(arrival_m=ARRIVAL_M, timeout_steps=int(endless), review_steps=int(endless))
        super().__init__(env, limits=limits, seed=0)

    @property
    def is_over(self) -> bool:
        """Whether the agent has arrived, or the navigator has given up for good."""
        left_m = np.linalg.norm(self._point_goal().position_xz - self.position_xz)
        return bool(left_m <= ARRIVAL_M) or len(self.failures) >= MAX_FAILURES

    def _begin_episode(self) -> None:
        """There is nothing to forget."""

    def _propose_goal(self) -> Goal:
        return self._point_goal()

    def _review_goal(self, goal: Goal) -> Goal:
        return goal

    def _point_goal(self) -> Goal:
        env = self.env.unwrapped
        assert isinstance(env, PointNavEnv)
        return Goal(env.goal_xz, None, "point goal")


def play_driven(navigator: str, episode: NavigationEpisode, image_px: int) -> dict[str, Any]:
    """Play one episode.

    Args:
        navigator: One of `agents.navigators.NAVIGATORS`.
        episode: What to play.
        image_px: Rows and columns of the depth image.

    Returns:
        `RESULTS` of the episode, `cpu_ms` per step, rendering included, and `handovers`, how often the
        navigator handed its goal over.
    """
    env = gymnasium.wrappers.TimeLimit(make_pointnav(episode, image_px), step_limit(episode.step_m))
    seat = PointGoalSeat(env)
    observation, info = seat.reset(seed=episode.seed)
    driver = make_navigator(navigator, seat, episode.seed)
    began_s, has_ended, is_first = time.process_time(), False, True
    while not has_ended:
        action = np.int64(Action.STOP)
        if not seat.is_over:
            action = np.int64(driver.predict(observation, None, np.array([is_first]))[0])
        if seat.is_over:
            action = np.int64(Action.STOP)
        observation, _, terminated, truncated, info = seat.step(action)
        has_ended, is_first = terminated or truncated, False
    cpu_ms = 1000.0 * (time.process_time() - began_s) / max(info["step"], 1)
    return {**{key: info[key] for key in RESULTS}, "cpu_ms": cpu_ms, "handovers": info["handovers_count"]}
