"""Exploration of an unknown scene."""

from typing import Any, final

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from anm_gym.actions import Action
from anm_gym.envs.mesh_env import MeshEnv, Observation


@final
class ExploreEnv(MeshEnv):
    """Explore an unknown indoor mesh with a depth camera.

    ## Description
    An agent stands somewhere on the largest navigable part of a storey. What is to be done with the
    depth it sees is left to wrappers and agents; the harness scores the surface that was observed.

    ## Action Space
    `Discrete(4)`: 0 stop, 1 move forward 6.5 cm, 2 turn left 10 degrees, 3 turn right 10 degrees. A
    blocked move stops at contact; the agent does not slide.

    ## Observation Space
    | key | shape | dtype | range | unit and frame |
    |---|---|---|---|---|
    | `depth` | (H, W, 1) | float32 | [0, max_depth_m] | metres along the optical axis; 0 is empty |
    | `gps` | (2,) | float32 | unbounded | metres ahead and to the right of the start pose |
    | `compass` | (1,) | float32 | [-pi, pi] | radians turned left since the start |
    | `world_from_camera` | (4, 4) | float32 | unbounded | camera pose, metres, world frame |
    | `rgb` (only with `rgb=True`) | (H, W, 3) | uint8 | [0, 255] | colour; needs EGL |

    ## Rewards
    0 at every step. Wrap the environment to reward what you want explored.

    ## Starting State
    A uniform cell of the largest navigable part and a uniform heading, unless `start` is given.

    ## Episode End
    Terminated by stop. Truncated after 1000 steps (`max_episode_steps` of `gymnasium.make`).

    ## Information
    `collided` (bool), `collisions` (int), `path_length_m` (float), `step` (int).

    ## Arguments
    | name | default | meaning |
    |---|---|---|
    | `scene` | `"home:flat:0"` | path of a mesh or plan, or `home:<tier>:<seed>` |
    | `scene_options` | None | `up_axis`, `unit`, `storey` of a mesh file |
    | `camera` | None | fields of `anm_gym.geometry.CameraSpec` |
    | `forward_step_m`, `turn_step_deg` | 0.065, 10 | size of the actions |
    | `start` | None | (x, z, heading_rad) of every episode |
    | `noise` | None | fields of `anm_gym.envs.noise.NoiseSpec`; off by default |
    | `backend`, `device` | `"embree"`, `"cpu"` | what casts the rays |
    | `rgb` | False | observe colour too |
    | `render_mode` | None | `"rgb_array"` or `"depth_array"` |

    >>> import gymnasium
    >>> env = gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0", camera={"width_px": 64})
    >>> observation, info = env.reset(seed=0)
    >>> observation["depth"].shape
    (256, 64, 1)

    ## Version History
    - v0: first version.
    """

    def _begin(self) -> None:
        pass

    def _judge(self, action: Action) -> tuple[float, bool]:
        return 0.0, action is Action.STOP

    def _task_spaces(self) -> dict[str, spaces.Space[Any]]:
        return {}

    def _task_observation(self) -> Observation:
        return {}

    def _task_info(self) -> dict[str, Any]:
        return {}

    def _goal_xz(self) -> NDArray[np.float64] | None:
        return None
