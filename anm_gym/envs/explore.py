"""Exploration of an unknown scene."""

from typing import Any, Final, final

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from anm_gym.actions import Action
from anm_gym.envs.mesh_env import MeshEnv, Observation
from anm_gym.envs.options import DEFAULT_SCENE, EpisodeOptions, MeshEnvSettings
from anm_gym.envs.picture import Moment
from anm_gym.envs.seen_floor import SeenFloor

REWARDS: Final = ("area", "none")


@final
class ExploreEnv(MeshEnv):
    """Explore an unknown indoor mesh with a depth camera.

    ## Description
    An agent stands somewhere on a storey that it does not know, and has a budget of steps to look
    around. What it makes of the depth images is left to wrappers and agents: a map, goals, a policy.
    The agent is a cylinder of 0.1 m radius and 1.5 m height; what is lower than 0.1 m it steps over.

    ## Action Space
    `Discrete(4)`, numbered as in Habitat:

    | number | action | effect by default |
    |---|---|---|
    | 0 | stop | ends the episode |
    | 1 | move forward | 6.5 cm; a blocked move ends at contact, without sliding |
    | 2 | turn left | 10 degrees |
    | 3 | turn right | 10 degrees |

    ## Observation Space
    `Dict`:

    | key | shape | dtype | range | unit and frame |
    |---|---|---|---|---|
    | `depth` | (H, W, 1) | float32 | [0, max_depth_m] | metres along the optical axis; 0 is empty |
    | `gps` | (2,) | float32 | unbounded | metres ahead and to the right of the start pose |
    | `compass` | (1,) | float32 | [-pi, pi] | radians turned left since the start |
    | `world_from_camera` | (4, 4) | float32 | unbounded | camera pose, metres, world frame |
    | `rgb` (only with `rgb=True`) | (H, W, 3) | uint8 | [0, 255] | colour; needs EGL |

    ## Rewards
    With `reward="area"`, the floor that this step has shown for the first time, in square metres:
    `r_t = A_t - A_(t-1)`, where `A_t` is the area of the reachable floor that any image up to step t
    has shown, and what the start shows is free. Only floor on which the body fits and that connects
    to the start counts, so the rewards add up to less than the navigable area of the storey. It is
    measured on the true depth, without noise. With `reward="none"` every reward is 0.

    ## Starting State
    The centre of a uniform cell of the largest navigable part of the storey and a uniform heading,
    unless `start` is given.

    ## Episode End
    Terminated by stop. Truncated after 1000 steps, unless `gymnasium.make` is given another
    `max_episode_steps`.

    ## Information
    | key | type | meaning |
    |---|---|---|
    | `collided` | bool | whether contact cut this step short |
    | `collisions` | int | how many steps it cut short in this episode |
    | `path_length_m` | float | distance moved, metres |
    | `step` | int | steps since the start |
    | `explored_m2` | float | `A_t`, square metres (only with `reward="area"`) |

    ## Arguments
    | name | default | meaning |
    |---|---|---|
    | `scene` | `"home:flat:0"` | path of a mesh or plan, `home:<tier>:<seed>`, or as `gibson:Denmark` |
    | `reward` | `"area"` | `"area"` or `"none"` |
    | `scene_options` | None | `up_axis`, `unit`, `storey` of a mesh file; `root` of the datasets |
    | `camera` | None | dict of fields of `anm_gym.geometry.CameraSpec` |
    | `forward_step_m` | 0.065 | length of a forward step, metres |
    | `turn_step_deg` | 10 | angle of a turn, degrees |
    | `start` | None | (x, z, heading_rad) of every episode |
    | `noise` | None | dict of fields of `anm_gym.envs.noise.NoiseSpec`; none by default |
    | `backend`, `device` | `"embree"`, `"cpu"` | what casts the rays; or `"warp"`, `"cuda:0"` |
    | `rgb` | False | observe colour too |
    | `render_mode` | None | `"rgb_array"` or `"depth_array"` |

    >>> import gymnasium
    >>> env = gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0", camera={"width_px": 64})
    >>> observation, info = env.reset(seed=0)
    >>> observation["depth"].shape
    (256, 64, 1)

    `reset` takes the options `scene` and `start`, for one episode:

    >>> x, z = env.unwrapped.simulator.state.position_xz
    >>> observation, info = env.reset(options={"start": (x, z, 0.0)})
    >>> env.close()

    ## Version History
    - v0: first version. Mended after 0.1.0: floor behind the foot of a wall is not paid for.
    """

    def __init__(
        self,
        scene: str = DEFAULT_SCENE,
        *,
        reward: str = "area",
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        if reward not in REWARDS:
            raise ValueError(f"`reward` must be one of {', '.join(REWARDS)}, got {reward!r}")
        self._seen_floor: SeenFloor | None = None
        self.is_rewarded = reward == "area"
        """Whether newly seen floor is paid for."""
        super().__init__(MeshEnvSettings(scene=scene, render_mode=render_mode, **settings))

    def _option_names(self) -> tuple[str, ...]:
        return ("scene", "start")

    def _begin(self, _options: EpisodeOptions, depth_m: NDArray[np.float32]) -> None:
        self._seen_floor = SeenFloor(self.simulator.grid, self.camera) if self.is_rewarded else None
        self._look_around(depth_m)

    def _judge(self, action: Action, depth_m: NDArray[np.float32]) -> tuple[float, bool]:
        return self._look_around(depth_m), action is Action.STOP

    def _look_around(self, depth_m: NDArray[np.float32]) -> float:
        """Take an image into account and return the area that it adds, square metres."""
        if self._seen_floor is None:
            return 0.0
        return self._seen_floor.look(depth_m, self.simulator.state)

    def _task_spaces(self) -> dict[str, spaces.Space[Any]]:
        return {}

    def _task_observation(self) -> Observation:
        return {}

    def _task_info(self) -> dict[str, Any]:
        return {} if self._seen_floor is None else {"explored_m2": self._seen_floor.area_m2}

    def _moment(self) -> Moment:
        seen = self._seen_floor
        captions = {} if seen is None else {"floor seen": f"{100.0 * seen.fraction:.0f} %"}
        return Moment(
            simulator=self.simulator,
            trajectory=self.trajectory,
            depth_m=self._depth_m,
            captions={**self._captions(), **captions},
            is_seen=None if seen is None else seen.is_seen,
        )
