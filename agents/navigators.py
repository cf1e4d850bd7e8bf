"""Point-goal navigators: they turn the current goal into actions.

Classical ones implement Stable-Baselines3's `predict`, so that a learned policy can take their seat.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Final, final

import gymnasium
import numpy as np
from numpy.typing import NDArray

from agents.batching import actions_for
from agents.cost_to_go import CostSettings, CostToGo, Floor, cost_to_go
from agents.rollouts import RolloutSettings, best_move, turn_towards
from anm_gym.actions import MOVES, Action
from anm_gym.geometry import wrap_angle
from anm_gym.stopwatch import Stopwatch
from anm_gym.wrappers.goal import Goal, GoalWrapper

State = tuple[NDArray[Any], ...] | None
MAX_REPORTS: Final = 2
"""Goals reported as unreachable before one action; then the move is random, as it is in the released
code when the learned navigator stops."""

STUCK_M: Final = 0.02
"""A forward step that is shorter than this met an obstacle, metres."""


@dataclass(frozen=True)
class FollowSettings:
    """When a way is planned anew and when a goal is given up (ours)."""

    replan_steps: int = 10
    """Steps after which the cost-to-go is searched anew, as more of the floor is known."""
    surprise_steps: float = 4.0
    """A best move that needs this many steps more than planned shows that the way is blocked."""
    goal_tolerance_m: float = 0.4
    """How far from the goal a way may end, metres."""
    end_m: float = 0.08
    """Distance at which the end of a way is reached, metres."""
    patience_steps: int = 40
    """Steps without coming nearer after which a goal is unreachable."""
    progress_steps: float = 1.0
    """What counts as coming nearer, expected steps."""
    max_setbacks: int = 8
    """Times that a way may turn out much longer before the goal counts as unreachable."""


class Navigator(ABC):
    """Drive an environment that sits under a `GoalWrapper`.

    Args:
        env: The environment, with a `GoalWrapper` as its outermost layer.
        costs: What the floor costs.
        settings: When to plan and when to give up.
        seed: Seeds the random moves of an agent that has nowhere to go.
    """

    def __init__(
        self, env: GoalWrapper, costs: CostSettings, settings: FollowSettings | None = None, seed: int = 0
    ) -> None:
        self.env, self.costs, self.settings = env, costs, settings or FollowSettings()
        self._seed = seed
        self.stopwatch = Stopwatch()
        self.compute_ms: Final = self.stopwatch.compute_ms
        self._last: Action | None = None
        self._forget()

    def predict(
        self,
        observation: Any,
        state: State = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,  # noqa: ARG002 - always as planned
    ) -> tuple[NDArray[np.int64], State]:
        """Choose an action; the signature is Stable-Baselines3's.

        Args:
            observation: The environment's last observation; only its shape matters, as the wrapper has mapped
                it already.
            state: Ignored and handed back.
            episode_start: Whether this is the first step of an episode.
            deterministic: Ignored.

        Returns:
            The action as a () or (1,) int64 array, as the observation is shaped, and the state.
        """
        if episode_start is not None and bool(np.any(episode_start)):
            self.stopwatch.reset()
            self._forget()
        self._feel()
        self._last = self._act()
        return actions_for(observation, self._last), state

    @abstractmethod
    def _floor(self) -> Floor:
        """What is known of the floor now."""

    def _forget(self) -> None:
        simulator = self.env.get_wrapper_attr("simulator")
        self._rollouts = RolloutSettings(simulator.forward_step_m, simulator.turn_step_rad)
        self._rng = np.random.default_rng(self._seed)
        self._last = None
        self._last_xz = np.full(2, np.inf)
        self._blocked_rad: list[float] = []
        self._take_up(None)

    def _take_up(self, goal: Goal | None) -> None:
        """Start afresh for a goal."""
        self._goal = goal
        self._way: CostToGo | None = None
        self._age_steps = self._idle_steps = self._setbacks = 0
        self._expected_steps = self._fewest_steps = np.inf

    def _feel(self) -> None:
        """Remember the headings in which the agent cannot move from where it stands."""
        moved_m = self._distance(self._last_xz)
        if moved_m > STUCK_M:
            self._blocked_rad, self._last_xz = [], self.env.position_xz
        elif self._last is Action.MOVE_FORWARD:
            self._blocked_rad.append(self.env.heading_rad)

    def _act(self) -> Action:
        """Move on; report goals that cannot be reached until one can."""
        for _ in range(MAX_REPORTS):
            if self.env.goal is not self._goal:
                self._take_up(self.env.goal)
            with self.stopwatch("plan"):
                action, problem = self._try()
            if action is not None:
                return action
            self.env.report_unreachable(problem)
        return MOVES[self._rng.integers(len(MOVES))]

    def _try(self) -> tuple[Action | None, str]:
        """Choose an action towards the goal; None and the reason if it is out of reach."""
        goal, position_xz = self.env.goal, self.env.position_xz
        is_near = self._distance(goal.position_xz) <= self.env.limits.arrival_m
        at_end = self._way is not None and self._distance(self._way.end_xz) <= self.settings.end_m
        if is_near or at_end:
            return self._align(goal)
        self._idle_steps += 1
        if self._idle_steps > self.settings.patience_steps or self._setbacks > self.settings.max_setbacks:
            return None, "no progress"
        floor = self._floor()
        action = self._follow(floor) if self._way and self._age_steps < self.settings.replan_steps else None
        if action is not None:
            return action, ""
        self._way = cost_to_go(
            floor, position_xz, goal.position_xz, self.costs, self.settings.goal_tolerance_m
        )
        self._age_steps, self._expected_steps = 0, np.inf
        action = self._follow(floor) if self._way else None
        return action, "no way"

    def _follow(self, floor: Floor) -> Action | None:
        """The best move on the way; None if there is none or the way got much longer than planned."""
        assert self._way is not None
        position_xz = self.env.position_xz
        reach_m = self._rollouts.max_steps * self._rollouts.forward_step_m + self.costs.comfort_m
        move = best_move(
            floor.window(position_xz, reach_m),
            self._way,
            position_xz,
            self.env.heading_rad,
            self._rollouts,
            self.costs,
            self._last,
            self._blocked_rad,
        )
        if move is None or move.remaining_steps > self._expected_steps + self.settings.surprise_steps:
            return None
        self._age_steps += 1
        self._expected_steps = move.remaining_steps
        self._judge_progress(move.remaining_steps, is_new=self._age_steps == 1)
        return move.action

    def _judge_progress(self, remaining_steps: float, *, is_new: bool) -> None:
        """Coming nearer renews the patience; so does a new way that is much longer, but not for ever."""
        if remaining_steps < self._fewest_steps - self.settings.progress_steps:
            self._fewest_steps, self._idle_steps = remaining_steps, 0
        elif is_new and remaining_steps > self._fewest_steps + self.settings.surprise_steps:
            self._fewest_steps, self._idle_steps = remaining_steps, 0
            self._setbacks += 1

    def _align(self, goal: Goal) -> tuple[Action | None, str]:
        """Turn to the goal's heading; if that is not enough, the goal itself is out of reach."""
        error_rad = 0.0
        if goal.heading_rad is not None:
            error_rad = wrap_angle(goal.heading_rad - self.env.heading_rad)
        if abs(error_rad) <= 0.51 * self._rollouts.turn_step_rad:
            return None, "as near as it gets"
        return turn_towards(error_rad), ""

    def _distance(self, point_xz: NDArray[np.float64]) -> float:
        return float(np.linalg.norm(point_xz - self.env.position_xz))


@final
class PlannerNavigator(Navigator):
    """Plan on what has been seen of the floor, with an aversion to the unknown."""

    def __init__(self, env: GoalWrapper, settings: FollowSettings | None = None, seed: int = 0) -> None:
        super().__init__(env, CostSettings(), settings, seed)

    def _floor(self) -> Floor:
        grid = self.env.occupancy
        return Floor(grid.frame, grid.occupied, grid.unknown, grid.stood)


@final
class OracleNavigator(Navigator):
    """Plan on the true traversable grid: an upper bound for navigators."""

    def __init__(self, env: GoalWrapper, settings: FollowSettings | None = None, seed: int = 0) -> None:
        body = env.get_wrapper_attr("simulator").grid.body
        super().__init__(env, CostSettings(body.radius_m, unknown_cost=None, escape_m=0.0), settings, seed)

    def _floor(self) -> Floor:
        grid = self.env.get_wrapper_attr("simulator").grid
        nowhere = np.zeros_like(grid.occupied)
        return Floor(grid.frame, grid.occupied | ~grid.has_floor, unknown=nowhere, stood=nowhere)


NAVIGATORS: Final[dict[str, type[PlannerNavigator] | type[OracleNavigator]]] = {
    "planner": PlannerNavigator,
    "oracle": OracleNavigator,
}
"""All navigators."""


def make_navigator(name: str, env: gymnasium.Env[Any, Any], seed: int = 0) -> Navigator:
    """Build a navigator by name.

    Args:
        name: One of `NAVIGATORS`.
        env: An environment whose outermost layer is a `GoalWrapper`.
        seed: Seeds the random moves of an agent that has nowhere to go.

    Raises:
        ValueError: If there is no such navigator.
        TypeError: If the environment is not under a `GoalWrapper`.
    """
    if name not in NAVIGATORS:
        raise ValueError(f"unknown navigator {name!r}; choose one of: {', '.join(sorted(NAVIGATORS))}")
    if not isinstance(env, GoalWrapper):
        raise TypeError(f"`env` must be wrapped in a GoalWrapper, got {type(env).__name__}")
    return NAVIGATORS[name](env, seed=seed)
