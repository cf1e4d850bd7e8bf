"""Point-goal navigation as Habitat defines it."""

from typing import Any, final

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from anm_gym.actions import Action
from anm_gym.envs.mesh_env import MeshEnv, Observation
from anm_gym.errors import EpisodeError
from anm_gym.geometry import pointgoal

SUCCESS_M = 0.2
"""Stopping within this of the goal is a success, metres (Habitat)."""
SLACK_REWARD, SUCCESS_REWARD = -0.01, 2.5
"""Habitat's reward of each step and of success."""
MIN_GEODESIC_M, MAX_GEODESIC_M = 1.0, 30.0
"""Limits of the geodesic distance of a goal, metres (Habitat's episode generator)."""
STRAIGHT_RATIO, STRAIGHT_SHARE = 1.1, 0.2
"""Paths less than this much longer than the straight line are kept with this probability only."""
MAX_DRAWS = 200
"""Goals that are drawn before the episode is given up."""


@final
class PointNavEnv(MeshEnv):
    """Walk to a point and stop there.

    ## Description
    The agent knows the polar position of its goal at every step (perfect GPS and compass) and must
    stop within 0.2 m of it.

    ## Action Space
    `Discrete(4)`: 0 stop, 1 move forward, 2 turn left, 3 turn right. The paper's 6.5 cm and 10 degrees
    by default; Habitat's step is `forward_step_m=0.25`.

    ## Observation Space
    | key | shape | dtype | range | unit and frame |
    |---|---|---|---|---|
    | `depth` | (H, W, 1) | float32 | [0, max_depth_m] | metres along the optical axis; 0 is empty |
    | `pointgoal_with_gps_compass` | (2,) | float32 | [0, inf), [-pi, pi] | distance (m), bearing (rad, left > 0) |
    | `gps` | (2,) | float32 | unbounded | metres ahead and to the right of the start pose |
    | `compass` | (1,) | float32 | [-pi, pi] | radians turned left since the start |
    | `world_from_camera` | (4, 4) | float32 | unbounded | camera pose, metres, world frame |
    | `rgb` (only with `rgb=True`) | (H, W, 3) | uint8 | [0, 255] | colour; needs EGL |

    ## Rewards
    `d(t - 1) - d(t) - 0.01 + 2.5 success`, where d is the geodesic distance to the goal in metres.

    ## Starting State
    A uniform start on the largest navigable part. The goal is uniform on the same part with a geodesic
    distance of 1 to 30 m; goals that lie nearly straight ahead (path less than 1.1 times the straight
    line) are kept with probability 0.2.

    ## Episode End
    Terminated by stop. Truncated after 500 steps (`max_episode_steps` of `gymnasium.make`).

    ## Information
    `collided` (bool), `collisions` (int), `path_length_m` (float), `step` (int),
    `distance_to_goal_m` (float), `is_success` (bool), `spl`, `soft_spl` (float).

    ## Arguments
    As `ANM/Explore-v0`.

    >>> import gymnasium
    >>> env = gymnasium.make("anm_gym:ANM/PointNav-v0", scene="home:studio:0", forward_step_m=0.25)
    >>> observation, info = env.reset(seed=0)
    >>> info["distance_to_goal_m"] >= 1.0
    True

    ## Version History
    - v0: first version.
    """

    def _begin(self) -> None:
        grid, graph = self.simulator.grid, self.simulator.graph
        start = self.simulator.state.position_xz
        distances = graph.distance_from(grid.frame.cells_of(start)[0])
        for _ in range(MAX_DRAWS):
            goal = grid.sample_position(self.np_random, grid.component_at(start))
            cell = grid.frame.cells_of(goal)[0]
            if self._is_fit(float(distances[cell[0], cell[1]]), float(np.linalg.norm(goal - start))):
                break
        else:
            raise EpisodeError(
                f"the scene must have a goal {MIN_GEODESIC_M} to {MAX_GEODESIC_M} m from the start, got none "
                f"in {MAX_DRAWS} draws; use a larger scene"
            )
        self._goal = goal
        self._distances = graph.distance_from(cell)
        self._distance_m = float(distances[cell[0], cell[1]])
        self._start_distance_m = self._distance_m
        self._has_succeeded = False

    def _judge(self, action: Action) -> tuple[float, bool]:
        before, self._distance_m = self._distance_m, self._geodesic_m()
        straight_m = float(np.linalg.norm(self._goal - self.simulator.state.position_xz))
        self._has_succeeded = action is Action.STOP and straight_m <= SUCCESS_M
        reward = before - self._distance_m + SLACK_REWARD + SUCCESS_REWARD * self._has_succeeded
        return float(reward), action is Action.STOP

    def _task_spaces(self) -> dict[str, spaces.Space[Any]]:
        low, high = np.array([0.0, -np.pi]), np.array([np.finfo(np.float32).max, np.pi])
        return {"pointgoal_with_gps_compass": spaces.Box(low.astype(np.float32), high.astype(np.float32))}

    def _task_observation(self) -> Observation:
        state = self.simulator.state
        return {"pointgoal_with_gps_compass": pointgoal(state.position_xz, state.heading_rad, self._goal)}

    def _task_info(self) -> dict[str, Any]:
        efficiency = self._start_distance_m / max(self._start_distance_m, self.path_length_m, 1e-9)
        progress = max(0.0, 1.0 - self._distance_m / max(self._start_distance_m, 1e-9))
        return {
            "distance_to_goal_m": float(self._distance_m),
            "is_success": bool(self._has_succeeded),
            "spl": float(efficiency * self._has_succeeded),
            "soft_spl": float(efficiency * progress),
        }

    def _goal_xz(self) -> NDArray[np.float64] | None:
        return self._goal

    def _is_fit(self, geodesic_m: float, straight_m: float) -> bool:
        """Habitat's rule on the distance and on the detour of a goal."""
        if not MIN_GEODESIC_M <= geodesic_m <= MAX_GEODESIC_M:
            return False
        is_straight = geodesic_m < STRAIGHT_RATIO * straight_m
        return not is_straight or bool(self.np_random.random() < STRAIGHT_SHARE)

    def _geodesic_m(self) -> float:
        """Geodesic distance from the agent to the goal, metres; the last one where a cell has no path."""
        cell = self.simulator.grid.frame.cells_of(self.simulator.state.position_xz)[0]
        distance_m = float(self._distances[cell[0], cell[1]])
        return distance_m if np.isfinite(distance_m) else self._distance_m
