"""Navigators that plan: on what has been seen of the floor, or on the true floor."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from agents.cost_to_go import CostSettings, CostToGo, Floor, cost_to_go
from agents.navigator import Navigator
from agents.rollouts import RolloutSettings, best_move, turn_towards
from anm_gym.actions import MOVES, STRAIGHT_TURNS, Action, least_move_m
from anm_gym.checks import check_at_least
from anm_gym.wrappers.goal import Goal, GoalWrapper

MAX_REPORTS: Final = 2
"""Goals reported as unreachable before one action; then the move is random, as it is in the released
code when the learned navigator stops."""


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

    def __post_init__(self) -> None:
        check_at_least(self, 1, "replan_steps", "patience_steps")
        check_at_least(self, 0, "surprise_steps", "progress_steps", "max_setbacks")
        check_at_least(self, 0.0, "goal_tolerance_m", "end_m")


class PlanningNavigator(Navigator):
    """Follow a plan over what is known of the floor, and plan anew as more of it is known.

    Args:
        env: The environment, with a `GoalWrapper` as its outermost layer.
        costs: What the floor costs.
        settings: When to plan and when to give up.
        seed: Seeds the random moves of an agent that has nowhere to go.
    """

    _last: Action | None

    def __init__(
        self, env: GoalWrapper, costs: CostSettings, settings: FollowSettings | None = None, seed: int = 0
    ) -> None:
        self.costs, self.settings = costs, settings or FollowSettings()
        super().__init__(env, seed)

    def begin_goal(self) -> None:
        """Start afresh for the current goal: another navigator has driven so far."""
        self._last = None  # what it did before has no say in where the agent stands now
        self._take_up(self.env.goal)

    @abstractmethod
    def _floor(self) -> Floor:
        """What is known of the floor now."""

    def _forget(self) -> None:
        self._rollouts = RolloutSettings(*self.env.step_sizes)
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
        moved_m = self._distance_m(self._last_xz)
        if moved_m > least_move_m(self._rollouts.forward_step_m):
            self._blocked_rad, self._last_xz = [], self.env.position_xz
        elif self._last is Action.MOVE_FORWARD:
            self._blocked_rad.append(self.env.heading_rad)

    def _act(self, _observation: Any) -> Action:
        """Move on; report goals that cannot be reached until one can."""
        self._feel()
        self._last = self._choose()
        return self._last

    def _choose(self) -> Action:
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
        is_near = self._distance_m(goal.position_xz) <= self.env.arrival_m
        at_end = self._way is not None and self._distance_m(self._way.end_xz) <= self.settings.end_m
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
        error_rad = self._heading_error_rad(goal)
        if abs(error_rad) <= STRAIGHT_TURNS * self._rollouts.turn_step_rad:
            return None, "as near as it gets"
        return turn_towards(error_rad), ""


@final
class PlannerNavigator(PlanningNavigator):
    """Plan on what has been seen of the floor, with an aversion to the unknown."""

    def __init__(self, env: GoalWrapper, settings: FollowSettings | None = None, seed: int = 0) -> None:
        super().__init__(env, CostSettings(), settings, seed)

    def _floor(self) -> Floor:
        grid = self.env.occupancy
        return Floor(grid.frame, grid.occupied, grid.unknown, grid.stood)


@final
class OracleNavigator(PlanningNavigator):
    """Plan on the true traversable grid: an upper bound for navigators."""

    def __init__(self, env: GoalWrapper, settings: FollowSettings | None = None, seed: int = 0) -> None:
        body = env.get_wrapper_attr("simulator").grid.body
        super().__init__(env, CostSettings(body.radius_m, unknown_cost=None, escape_m=0.0), settings, seed)

    def _floor(self) -> Floor:
        grid = self.env.get_wrapper_attr("simulator").grid
        nowhere = np.zeros_like(grid.occupied)
        return Floor(grid.frame, grid.occupied | ~grid.has_floor, unknown=nowhere, stood=nowhere)
