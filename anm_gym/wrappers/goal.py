"""The seat of every goal source: an exploration environment becomes a point-goal environment.

The base class decides when a goal has ended; subclasses decide which comes next.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from anm_gym.actions import NEAREST_STEPS, STRAIGHT_TURNS
from anm_gym.checks import check_at_least, check_positive
from anm_gym.envs.mesh_env import Observation
from anm_gym.geometry import heading_of, pointgoal, wrap_angle
from anm_gym.map.occupancy import OccupancyGrid
from anm_gym.map.reach import ReachSettings, reachable_space
from anm_gym.stopwatch import Stopwatch
from anm_gym.wrappers.needs import require_exploration, require_steps

SWEEP_REASON = "sweep"
"""Reason of the goals of a turn once round."""
ALREADY_THERE = "already there"
"""Reason of failures that were reached when they were proposed: what they promised is not to be had."""
MAX_PROPOSALS = 10
"""Goals that are asked for in a row while the agent already stands at each of them."""


@dataclass(frozen=True, eq=False)
class Goal:
    """A floor point for the navigator."""

    position_xz: NDArray[np.float64]
    """(2,) floor point, metres, world frame."""
    heading_rad: float | None
    """Where to look on arrival, radians; None if it does not matter."""
    reason: str
    """Why it was proposed, for reports."""


@dataclass(frozen=True)
class GoalLimits:
    """When a goal has ended."""

    arrival_m: float = 0.2
    """Distance at which a goal is reached, metres; see also `GoalWrapper.arrival_m`."""
    arrival_deg: float = 10.0
    """Heading error at which a goal with a heading is reached, degrees; see `GoalWrapper.arrival_rad`."""
    timeout_steps: int = 200
    """Steps after which a goal is given up."""
    review_steps: int = 10
    """Steps between two reviews of a goal that is being approached."""

    def __post_init__(self) -> None:
        check_positive(self, "arrival_m", "arrival_deg")
        check_at_least(self, 1, "timeout_steps", "review_steps")


class GoalWrapper(
    gymnasium.Wrapper[Observation, np.int64, Observation, np.int64], RecordConstructorArgs, ABC
):
    """Turn an exploration environment into a sequence of point goals.

    ## Observation
    Adds `pointgoal_with_gps_compass`, (2,) float32: distance (m) and bearing (rad, left positive) of
    the current goal.

    ## Action, reward, episode end
    Unchanged.

    ## Information
    Adds `goal_distance_m` (float), `goals_count` (int) and `handovers_count` (int).

    ## Needs
    Observations of `ANM/Explore-v0`, its `camera` and its `step_sizes`; `collided` in `info` is used where it
    is there. Uses the occupancy grid of a neural map below it, or keeps its own.

    ## Version history
    - v0: first version.
    """

    def __init_subclass__(cls, **options: Any) -> None:
        """Have the arguments of subclasses recorded, for `spec` and for the settings' hash in result rows."""
        super().__init_subclass__(**options)
        if "__init__" in vars(cls):
            cls.__init__ = _recording(cls.__init__)  # type: ignore[method-assign]

    def __init__(self, env: gymnasium.Env[Observation, np.int64], *, limits: GoalLimits, seed: int) -> None:
        gymnasium.Wrapper.__init__(self, env)
        require_exploration(env)
        require_steps(env)
        goal_space = spaces.Box(
            np.array([0.0, -np.pi], np.float32), np.array([np.finfo(np.float32).max, np.pi], np.float32)
        )
        assert isinstance(env.observation_space, spaces.Dict)
        self.observation_space = spaces.Dict(
            {**env.observation_space.spaces, "pointgoal_with_gps_compass": goal_space}
        )
        self.limits: GoalLimits = limits
        self.stopwatch: Stopwatch = Stopwatch()
        self.compute_ms = self.stopwatch.compute_ms
        self.rng: np.random.Generator = np.random.default_rng(seed)
        self.num_episodes: int = 0
        self._is_parents_record: bool = False
        self._seed: int = seed
        self._has_neural_map: bool = env.has_wrapper_attr("neural_map")
        self._grid: OccupancyGrid | None = None
        self._last_pose: NDArray[np.float64] | None = None
        self._goal: Goal | None = None
        self._goal_steps: int = 0
        self._sweep_rad: list[float] = []
        self._trail_xz: list[NDArray[np.float64]] = []
        self.goals: list[Goal] = []
        self.failures: list[Goal] = []
        self.handovers: list[Goal] = []

    @property
    def goal(self) -> Goal:
        """The current goal; an episode always has one."""
        if self._goal is None:
            raise gymnasium.error.ResetNeeded("there is no goal yet; call `reset` first")
        return self._goal

    @property
    def occupancy(self) -> OccupancyGrid:
        """What is known of the floor; the navigator plans on it."""
        if self._has_neural_map:
            grid = self.env.get_wrapper_attr("neural_map").occupancy
            assert isinstance(grid, OccupancyGrid)
            return grid
        if self._grid is None:
            raise gymnasium.error.ResetNeeded("there is no map yet; call `reset` first")
        return self._grid

    @property
    def position_xz(self) -> NDArray[np.float64]:
        """(2,) where the agent stands, metres."""
        return np.asarray(self._pose[[0, 2], 3], np.float64)

    @property
    def heading_rad(self) -> float:
        """Where the agent looks, radians."""
        return heading_of(self._pose)

    @property
    def _pose(self) -> NDArray[np.float64]:
        """(4, 4) pose of the camera."""
        if self._last_pose is None:
            raise gymnasium.error.ResetNeeded("nobody knows where the agent is yet; call `reset` first")
        return self._last_pose

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode and propose the first goal; without a seed, draws go on from the last episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self.num_episodes += 1
        if seed is not None:
            self.rng = np.random.default_rng([self._seed, seed])
        self.stopwatch.reset()
        self._grid, self._goal = None, None
        self._sweep_rad, self._trail_xz = [], []
        self.goals, self.failures, self.handovers = [], [], []
        self._look(observation, info)
        self._begin_episode()
        self._see(observation)
        self._replace_goal()
        return self._with_goal(observation, info)

    def step(self, action: np.int64) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act, update the map, and replace the goal if it has ended."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._look(observation, info)
        self._see(observation)
        self._goal_steps += 1
        if self.is_reached(self.goal):
            self._replace_goal()
        elif self._goal_steps >= self.limits.timeout_steps:
            self.report_unreachable("timeout")
        elif self._goal_steps % self.limits.review_steps == 0:
            self._review()
        observation, info = self._with_goal(observation, info)
        return observation, float(reward), terminated, truncated, info

    def report_unreachable(self, reason: str) -> None:
        """Give the current goal up and propose another; navigators call this.

        Args:
            reason: Filed with the goal.
        """
        goal = self.goal
        self.failures.append(Goal(goal.position_xz, goal.heading_rad, reason))
        self._replace_goal()

    def near_failure(
        self, places_xz: ArrayLike, radius_m: float, latest: int | None = None
    ) -> NDArray[np.bool_]:
        """Tell which floor points lie near a goal that failed.

        Args:
            places_xz: (N, 2) floor points, metres.
            radius_m: Points nearer than this are near, metres.
            latest: How many of the latest failures count; None for all.

        Returns:
            (N,) bool.
        """
        places = np.asarray(places_xz, np.float64).reshape(-1, 1, 2)
        failures = self.failures if latest is None else self.failures[::-1][:latest]
        failed = np.array([goal.position_xz for goal in failures]).reshape(-1, 2)
        return np.asarray((np.linalg.norm(places - failed, axis=2) < radius_m).any(axis=1))

    def is_reached(self, goal: Goal) -> bool:
        """Tell whether the agent stands at a goal and looks where it asks for, as near as its steps allow."""
        if np.linalg.norm(goal.position_xz - self.position_xz) > self.arrival_m:
            return False
        if goal.heading_rad is None:
            return True
        return bool(abs(wrap_angle(goal.heading_rad - self.heading_rad)) <= self.arrival_rad)

    @property
    def arrival_m(self) -> float:
        """Distance at which a goal is reached: the limit, or half a forward step if that is more, metres."""
        return max(self.limits.arrival_m, NEAREST_STEPS * self.step_sizes[0])

    @property
    def arrival_rad(self) -> float:
        """Heading error at which it is: the limit, or a little more than half a turn, radians."""
        return max(float(np.deg2rad(self.limits.arrival_deg)), STRAIGHT_TURNS * self.step_sizes[1])

    def note_handover(self, reason: str) -> None:
        """Take note that another navigator drives to the current goal from here; it stays the goal.

        Args:
            reason: Filed with the goal.
        """
        self.handovers.append(Goal(self.goal.position_xz, self.goal.heading_rad, reason))

    @property
    def step_sizes(self) -> tuple[float, float]:
        """Length of the agent's forward step, metres, and angle of its turn, radians."""
        forward_step_m, turn_step_rad = self.env.get_wrapper_attr("step_sizes")
        return float(forward_step_m), float(turn_step_rad)

    @property
    def turn_cost_m(self) -> float:
        """Length of a walk that takes as many steps as a turn of a radian, metres."""
        forward_step_m, turn_step_rad = self.step_sizes
        return forward_step_m / turn_step_rad

    def look_round(self) -> None:
        """Turn once round on the spot before the next goal is proposed; sources call this."""
        self._sweep_rad = [
            wrap_angle(self.heading_rad + turn) for turn in 2.0 * np.pi / 3.0 * np.arange(3, 0, -1)
        ]

    def wander_goal(self) -> Goal:
        """The reachable place farthest from the trail: what is left when a source has nothing to propose."""
        space = reachable_space(self.occupancy, self.position_xz, ReachSettings())
        if space is None:
            return Goal(self.position_xz, wrap_angle(self.heading_rad + np.pi), "turn round")
        trail = space.frame.cells_of(
            np.stack([*self._trail_xz, *(goal.position_xz for goal in self.failures)])
        )
        trail = trail[space.frame.contains(trail)]
        unvisited = np.ones(space.frame.shape, bool)
        unvisited[trail[:, 0], trail[:, 1]] = False
        distance = ndimage.distance_transform_edt(unvisited)
        farthest = np.argmax(np.where(space.reachable, distance, -1.0))
        cell = np.unravel_index(farthest, space.frame.shape)
        return Goal(space.frame.centers_of(cell)[0], None, "wander")

    @abstractmethod
    def _begin_episode(self) -> None:
        """Forget what belongs to the last episode; the first observation has been mapped."""

    @abstractmethod
    def _propose_goal(self) -> Goal | None:
        """Choose the next goal; None if there is nothing to choose."""

    @abstractmethod
    def _review_goal(self, goal: Goal) -> Goal | None:
        """Look again at a goal under way: return it to keep it, another to change, None to propose."""

    def _see(self, observation: Observation) -> None:
        """Take note of an observation; for sources that need more than the map."""

    def _look(self, observation: Observation, info: dict[str, Any]) -> None:
        self._last_pose = observation["world_from_camera"].astype(np.float64)
        self._trail_xz.append(self.position_xz)
        with self.stopwatch("occupancy"):
            if not self._has_neural_map:
                camera = self.get_wrapper_attr("camera")
                if self._grid is None:
                    self._grid = OccupancyGrid.below(camera, self._pose)
                self._grid.integrate(observation["depth"], camera, self._pose)
            if info.get("collided", False):
                self.occupancy.mark_contact(self._pose)

    def _review(self) -> None:
        if self.goal.reason == SWEEP_REASON:
            return
        with self.stopwatch("goal"):
            reviewed = self._review_goal(self.goal)
        if reviewed is None:
            self._replace_goal()
        elif reviewed is not self.goal:
            self._set_goal(reviewed)

    def _replace_goal(self) -> None:
        """Take the next goal; one at which the agent already stands has failed, so that another is found."""
        with self.stopwatch("goal"):
            for _ in range(MAX_PROPOSALS):
                self._set_goal(self._next_goal())
                if not self.is_reached(self.goal):
                    return
                self.failures.append(replace(self.goal, reason=ALREADY_THERE))
            self._set_goal(self.wander_goal())

    def _next_goal(self) -> Goal:
        if self._sweep_rad:
            return Goal(self.position_xz, self._sweep_rad.pop(), SWEEP_REASON)
        return self._propose_goal() or self.wander_goal()

    def _set_goal(self, goal: Goal) -> None:
        self._goal, self._goal_steps = goal, 0
        self.goals.append(goal)

    def _with_goal(
        self, observation: Observation, info: dict[str, Any]
    ) -> tuple[Observation, dict[str, Any]]:
        polar = pointgoal(self.position_xz, self.heading_rad, self.goal.position_xz)
        added = {
            "goal_distance_m": float(polar[0]),
            "goals_count": len(self.goals),
            "handovers_count": len(self.handovers),
        }
        return {**observation, "pointgoal_with_gps_compass": polar}, {**info, **added}


def _recording(construct: Callable[..., None]) -> Callable[..., None]:
    """Let a class's constructor record its arguments besides the environment, unless it does that itself.

    What a parent's constructor has recorded does not say how to make the child, and is replaced.
    """
    parameters = signature(construct)

    @wraps(construct)
    def recorded(self: GoalWrapper, *args: Any, **kwargs: Any) -> None:
        had_recorded = "_saved_kwargs" in vars(self)
        construct(self, *args, **kwargs)
        is_recorded = "_saved_kwargs" in vars(self)
        if type(self).__init__ is not recorded:
            self._is_parents_record = is_recorded and not had_recorded
        elif not is_recorded or self._is_parents_record:
            vars(self).pop("_saved_kwargs", None)
            named = _named(parameters, self, *args, **kwargs)
            RecordConstructorArgs.__init__(self, _disable_deepcopy=True, **named)

    return recorded


def _named(parameters: Signature, *args: Any, **kwargs: Any) -> dict[str, Any]:
    """The arguments of a wrapper's constructor by name, without the wrapper and its environment."""
    bound = parameters.bind(*args, **kwargs)
    bound.apply_defaults()
    named = dict(bound.arguments)
    named.pop(next(iter(named)))
    named.pop("env" if "env" in named else next(iter(named)))
    for name, parameter in parameters.parameters.items():
        if parameter.kind is Parameter.VAR_KEYWORD:
            named |= named.pop(name)
    return named
