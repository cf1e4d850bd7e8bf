"""The learned navigator in the seat under a goal wrapper, alone or with the planner behind it."""

from dataclasses import dataclass
from typing import Any, Final, Literal, final

import numpy as np
from numpy.typing import NDArray

from agents.learned_policy import LearnedPolicy
from agents.navigation_observer import NavigationObserver
from agents.navigator import Navigator
from agents.navigator_net import NavigatorNet
from agents.planning_navigators import PlannerNavigator
from agents.policy_file import load_policy, policy_identity
from agents.rollouts import turn_towards
from anm_gym.actions import MOVES, STRAIGHT_TURNS, Action
from anm_gym.checks import check_at_least, check_choices
from anm_gym.geometry import pointgoal
from anm_gym.wrappers.goal import Goal, GoalWrapper


@dataclass(frozen=True)
class LearnedSettings:
    """How a learned navigator is used."""

    policy: str = "ddppo-plus"
    """Name of the weights that come with a checkout, or a file."""
    deterministic: bool = False
    """Take the likeliest action instead of drawing one."""
    resets_memory: bool = True
    """Forget the LSTM's state at a new goal (the released code never does)."""
    has_reflexes: bool = True
    """Whether moves that cannot help are left out; see `agents.reflexes`."""
    stop: Literal["go_on", "random"] = "go_on"
    """When the policy stops away from the goal: `go_on` takes its next choice, `random` moves at random,
    as the released code does."""
    patience_steps: int = 80
    """Steps without coming nearer after which a goal is given up, or handed to the planner."""
    progress_m: float = 0.1
    """What counts as coming nearer, metres."""
    hands_over: bool = False
    """Whether the planner takes over where the policy is stuck."""

    def __post_init__(self) -> None:
        check_choices(self)
        check_at_least(self, 0.0, "patience_steps", "progress_m")


@final
class DDPPONavigator(Navigator):
    """Let a trained network choose the moves to the goals of a wrapper.

    Args:
        env: The environment, with a `GoalWrapper` as its outermost layer.
        settings: How the policy is used.
        seed: Seeds the draws of actions.

    Raises:
        PolicyError: If the weights cannot be read.

    Source:
        Wijmans et al., DD-PPO, ICLR 2020; in this seat: Active Neural Mapping, Sec. 4.3. That the LSTM is
        reset at a new goal and a stop is not answered by a random move is ours, and a flag.
    """

    def __init__(self, env: GoalWrapper, settings: LearnedSettings | None = None, seed: int = 0) -> None:
        self.settings = settings or LearnedSettings()
        self._net: NavigatorNet = load_policy(self.settings.policy)
        self.policy_identity = policy_identity(self._net)
        self._planner = PlannerNavigator(env, seed=seed) if self.settings.hands_over else None
        super().__init__(env, seed)
        if self._planner is not None:
            self._planner.stopwatch = self.stopwatch

    def _forget(self) -> None:
        forward_step_m, self._turn_step_rad = self.env.step_sizes
        camera = self.env.get_wrapper_attr("camera")
        self._observer = NavigationObserver(
            1,
            camera,
            camera.sensor_height_m,
            forward_step_m,
            self._net.settings.at_work(),
            self._turn_step_rad,
        )
        self._policy = LearnedPolicy(self._net, 1, self._seed, deterministic=self.settings.deterministic)
        self._rng = np.random.default_rng(self._seed)
        self._goal: Goal | None = None
        self._is_handed_over, self._idle_steps = False, 0
        if self._planner is not None:
            self._planner.begin_episode()

    def _act(self, observation: Any) -> Action:
        self._count_idle_steps()
        if self._idle_steps > self.settings.patience_steps:
            self._give_up()
        if self.env.goal is not self._goal:
            self._take_up(self.env.goal)
        with self.stopwatch("plan"):
            shown = self._look(observation)
        action = self._planned(observation) if self._is_handed_over else self._learned(shown)
        self._observer.note(np.array([int(action)]))
        return action

    def _take_up(self, goal: Goal) -> None:
        self._goal, self._is_handed_over = goal, False
        self._nearest_m = np.inf
        self._observer.begin_goal(0, shows_start=self.settings.resets_memory)
        if self.settings.resets_memory:
            self._policy.begin(0)

    def _count_idle_steps(self) -> None:
        """Count the steps without coming nearer to a goal under way."""
        if self._goal is not self.env.goal or self._is_handed_over:
            self._idle_steps = 0
            return
        distance_m = self._distance_m(self.env.goal.position_xz)
        self._idle_steps += 1
        if distance_m < self._nearest_m - self.settings.progress_m:
            self._nearest_m, self._idle_steps = distance_m, 0

    def _give_up(self) -> None:
        """Hand the goal to the planner, or to the wrapper."""
        if self._planner is None:
            self.env.report_unreachable("no progress")
            return
        self.env.note_handover("no progress")
        self._planner.begin_goal()
        self._is_handed_over = True

    def _look(self, observation: Any) -> dict[str, Any]:
        """Show the network what is seen, remembered and wanted; the memory is kept up to date always."""
        goal = pointgoal(self.env.position_xz, self.env.heading_rad, self.env.goal.position_xz)
        depth = np.asarray(observation["depth"])
        pose = np.asarray(observation["world_from_camera"], np.float32)
        self._pose = pose.reshape(-1, 4, 4)[-1:]
        return self._observer.observe(depth.reshape(-1, *depth.shape[-3:])[-1:], self._pose, goal[None])

    def _learned(self, shown: dict[str, Any]) -> Action:
        with self.stopwatch("plan"):
            return self._move(shown)

    def _move(self, shown: dict[str, Any]) -> Action:
        goal = self.env.goal
        if self._distance_m(goal.position_xz) <= self.env.arrival_m:
            error_rad = self._heading_error_rad(goal)
            if abs(error_rad) > STRAIGHT_TURNS * self._turn_step_rad:
                return turn_towards(error_rad)
        action = Action(int(self._policy.act(shown, self._allowed())[0]))
        return MOVES[self._rng.integers(len(MOVES))] if action is Action.STOP else action

    def _allowed(self) -> NDArray[np.bool_]:
        """(1, actions) the choices; the wrapper ends a goal, so that a stop never does."""
        allowed = np.ones((1, len(Action)), bool)
        if self.settings.has_reflexes:
            allowed = self._observer.allowed(self._pose, np.full((1, 2), np.inf, np.float32))
        allowed[:, int(Action.STOP)] = self.settings.stop == "random"
        return allowed

    def _planned(self, observation: Any) -> Action:
        """Ask the planner, on whose own clock it runs: what it reports is the goals' time."""
        assert self._planner is not None, "only the planner is handed goals"
        action, _ = self._planner.predict(observation)
        return Action(int(np.ravel(action)[0]))


PLUS: Final = LearnedSettings()
"""The navigator that has seen all tiers of homes."""
STAR: Final = LearnedSettings(policy="ddppo-star")
"""The navigator that has seen small homes only."""
