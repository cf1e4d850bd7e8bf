"""Navigation to a point that the agent can always see on its compass."""

from collections.abc import Iterator
from typing import Any, Final, final

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from anm_gym.actions import Action
from anm_gym.envs.goals import MAX_STARTS, GoalRange, draw_ends
from anm_gym.envs.mesh_env import UNBOUNDED, MeshEnv, Observation
from anm_gym.envs.options import DEFAULT_SCENE, EpisodeOptions, MeshEnvSettings
from anm_gym.envs.picture import Moment
from anm_gym.geometry import pointgoal
from anm_gym.sim.point_distance import DistanceToPoint, Ways

SLACK_REWARD: Final = -0.01
"""Reward of every step (Habitat)."""
SUCCESS_REWARD: Final = 2.5
"""Reward of stopping at the goal (Habitat)."""
SUCCESS_M: Final = 0.2
"""Geodesic distance within which a stop succeeds, metres (Habitat)."""


@final
class PointNavEnv(MeshEnv):
    """Go to a point on the floor and stop there.

    ## Description
    The agent of `ANM/Explore-v0` is told at every step where a point of the floor lies, as the crow
    flies, and must find the way. A policy that is good at this can sit in the navigator's seat of
    every goal wrapper, which calls its goals by the same name.

    ## Action Space
    `Discrete(4)`: 0 stop, 1 move forward 6.5 cm, 2 turn left 10 degrees, 3 turn right 10 degrees, as
    in `ANM/Explore-v0`.

    ## Observation Space
    `Dict` of `ANM/Explore-v0` and:

    | key | shape | dtype | range | unit and frame |
    |---|---|---|---|---|
    | `pointgoal_with_gps_compass` | (2,) | float32 | [0, inf), [-pi, pi] | metres; radians, left > 0 |

    ## Rewards
    Habitat's: `r_t = d_(t-1) - d_t - 0.01 + 2.5 * success`, with the geodesic distance d to the goal
    in metres, and `success` when the agent stops with `d_t < success_m`.

    ## Starting State
    The start is drawn as in `ANM/Explore-v0`; the goal is then drawn among the places at a geodesic
    distance of 1 to 30 m, straight ways being refused more often, as Habitat's generator does it.

    ## Episode End
    Terminated by stop, wherever it happens. Truncated after 500 steps, unless `gymnasium.make` is
    given another `max_episode_steps`. The step is a quarter of Habitat's: give far goals more.

    ## Information
    | key | type | meaning |
    |---|---|---|
    | `collided`, `collisions`, `path_length_m`, `step` | | as in `ANM/Explore-v0` |
    | `distance_to_goal_m` | float | geodesic distance d, metres |
    | `is_success` | bool | whether the agent has stopped at the goal |
    | `spl` | float | success times l / max(l, path length), with l the distance at the start |
    | `soft_spl` | float | the same, with the progress max(0, 1 - d / l) for success |

    ## Arguments
    Those of `ANM/Explore-v0` but `reward`, and:

    | name | default | meaning |
    |---|---|---|
    | `success_m` | 0.2 | distance within which a stop succeeds, metres |
    | `min_distance_m`, `max_distance_m` | 1, 30 | geodesic distance of the goal, metres |

    >>> import gymnasium
    >>> env = gymnasium.make("anm_gym:ANM/PointNav-v0", scene="home:studio:0", camera={"width_px": 64})
    >>> observation, info = env.reset(seed=0)
    >>> distance_m, bearing_rad = observation["pointgoal_with_gps_compass"]
    >>> bool(distance_m <= info["distance_to_goal_m"])
    True

    `reset` takes the options `scene`, `start` and `goal` (x, z), for one episode.

    ## Version History
    - v0: first version.
    """

    def __init__(
        self,
        scene: str = DEFAULT_SCENE,
        *,
        success_m: float = SUCCESS_M,
        min_distance_m: float = 1.0,
        max_distance_m: float = 30.0,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        if not success_m > 0.0:
            raise ValueError(f"`success_m` must be > 0, got {success_m}")
        self._success_m = success_m
        self._goal_range = GoalRange(min_distance_m, max_distance_m)
        super().__init__(MeshEnvSettings(scene=scene, render_mode=render_mode, **settings))
        self._distance_to_goal: DistanceToPoint | None = None
        self._distance_m = self._shortest_m = float("inf")
        self._has_succeeded = False

    def __getstate__(self) -> dict[str, Any]:
        """Of the distances, keep the ways that were found; the floor under them is made again."""
        state = super().__getstate__()
        if self._distance_to_goal is not None:
            state["_distance_to_goal"] = self._distance_to_goal.ways
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Lay the ways on the floor of the scene."""
        super().__setstate__(state)
        if (ways := state["_distance_to_goal"]) is not None:
            self._distance_to_goal = self._distances(ways)

    @property
    def goal_xz(self) -> NDArray[np.float64]:
        """(2,) the goal of the current episode, metres, world frame."""
        if self._distance_to_goal is None:
            raise gymnasium.error.ResetNeeded("there is no goal yet; call `reset` first")
        return self._goal_xz

    def _option_names(self) -> tuple[str, ...]:
        return ("scene", "start", "goal")

    def _begin(self, options: EpisodeOptions, _depth_m: NDArray[np.float32]) -> None:
        simulator = self.simulator
        grid, start_xz = simulator.grid, simulator.state.position_xz
        if options.goal is None:
            start_is_free = options.start is None and self._start is None
            starts = self._starts(MAX_STARTS if start_is_free else 1)
            start_xz, self._goal_xz = draw_ends(
                starts, grid, simulator.graph, self._goal_range, self.np_random
            )
        else:
            self._require_largest_part("goal", options.goal)
            self._goal_xz = options.goal
        self._distance_to_goal = self._distances()
        self._distance_m = self._shortest_m = self._distance_to_goal(start_xz)
        self._has_succeeded = False

    def _starts(self, count: int) -> Iterator[NDArray[np.float64]]:
        """Yield (2,) the start, and others in its place for as long as they are asked for."""
        yield self.simulator.state.position_xz
        for _ in range(count - 1):
            self._place(None)
            self._look(self.simulator.depth_m())
            yield self.simulator.state.position_xz

    def _distances(self, ways: Ways | None = None) -> DistanceToPoint:
        return DistanceToPoint(self.simulator.grid, self.simulator.graph, self._goal_xz, ways=ways)

    def _judge(self, action: Action, _depth_m: NDArray[np.float32]) -> tuple[float, bool]:
        assert self._distance_to_goal is not None, "an episode has begun"
        before_m, self._distance_m = (
            self._distance_m,
            self._distance_to_goal(self.simulator.state.position_xz),
        )
        has_stopped = action is Action.STOP
        self._has_succeeded = has_stopped and self._distance_m < self._success_m
        reward = before_m - self._distance_m + SLACK_REWARD + SUCCESS_REWARD * self._has_succeeded
        return reward, has_stopped

    def _task_spaces(self) -> dict[str, spaces.Space[Any]]:
        low, high = np.array([0.0, -np.pi], np.float32), np.array([UNBOUNDED, np.pi], np.float32)
        return {"pointgoal_with_gps_compass": spaces.Box(low, high)}

    def _task_observation(self) -> Observation:
        state = self.simulator.state
        return {"pointgoal_with_gps_compass": pointgoal(state.position_xz, state.heading_rad, self._goal_xz)}

    def _task_info(self) -> dict[str, Any]:
        longest_m = max(self._shortest_m, self.path_length_m)
        efficiency = self._shortest_m / longest_m if longest_m > 0.0 else 1.0
        progress = max(0.0, 1.0 - self._distance_m / max(self._shortest_m, 1e-9))
        return {
            "distance_to_goal_m": self._distance_m,
            "is_success": self._has_succeeded,
            "spl": self._has_succeeded * efficiency,
            "soft_spl": progress * efficiency,
        }

    def _moment(self) -> Moment:
        return Moment(
            simulator=self.simulator,
            trajectory=self.trajectory,
            depth_m=self._depth_m,
            captions={**self._captions(), "goal": f"{self._distance_m:.1f} m"},
            goal_xz=self._goal_xz,
        )
