"""What a small policy looks at: a map around the agent and a small depth image, both in bytes.

Stable-Baselines3 takes only bytes for images; in bytes, channels first, its own policies convolve them.
"""

from typing import Any, Final, final

import cv2
import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from anm_gym.envs.mesh_env import Observation
from anm_gym.envs.options import read_names
from anm_gym.geometry import forward_xz, heading_of
from anm_gym.map.occupancy import OccupancyGrid
from anm_gym.wrappers.needs import require_exploration
from anm_gym.wrappers.occupancy import has_occupancy

MAP_CHANNELS: Final = ("occupied", "free", "stood")
"""Channels of `ego_map`."""


@final
class PolicyViewWrapper(
    gymnasium.Wrapper[Observation, np.int64, Observation, np.int64], RecordConstructorArgs
):
    """Observe a crop of the occupancy grid that turns with the agent, and a shrunk depth image.

    ## Observation
    `Dict` of those of the following that are asked for, and no more:

    | key | shape | dtype | meaning |
    |---|---|---|---|
    | `ego_map` | (3, `map_px`, `map_px`) | uint8 | 255 where occupied, free, stood on |
    | `depth_image` | (1, `depth_px`, `depth_px`) | uint8 | 0 to 255 for 0 to `max_depth_m` |
    | those of `keys` | | | as in the environment below |

    In the map the agent stands in the middle and looks at row 0.

    ## Action, reward, episode end, information
    Unchanged.

    ## Needs
    Observations of `ANM/Explore-v0`; for `ego_map`, an `OccupancyWrapper` or a goal wrapper below.

    Args:
        env: The environment.
        map_px: Edge of the map, pixels; 0 for none.
        pixel_m: Edge of a pixel of the map, metres.
        depth_px: Edge of the depth image, pixels; 0 for none.
        keys: Other keys that are handed on.

    Example:
        >>> from anm_gym.wrappers.occupancy import OccupancyWrapper
        >>> env = gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0")
        >>> env = PolicyViewWrapper(OccupancyWrapper(env))
        >>> observation, info = env.reset(seed=0)
        >>> {key: value.shape for key, value in observation.items()}
        {'ego_map': (3, 64, 64), 'depth_image': (1, 64, 64)}

    ## Version history
    - v0: first version.
    """

    def __init__(
        self,
        env: gymnasium.Env[Observation, np.int64],
        *,
        map_px: int = 64,
        pixel_m: float = 0.1,
        depth_px: int = 64,
        keys: tuple[str, ...] = (),
    ) -> None:
        RecordConstructorArgs.__init__(self, map_px=map_px, pixel_m=pixel_m, depth_px=depth_px, keys=keys)
        super().__init__(env)
        require_exploration(env)
        assert isinstance(env.observation_space, spaces.Dict)
        below = env.observation_space.spaces
        if map_px < 0 or depth_px < 0 or not pixel_m > 0.0:
            raise ValueError(
                "`map_px` and `depth_px` must be >= 0 and `pixel_m` > 0, "
                f"got {map_px}, {depth_px} and {pixel_m}"
            )
        keys = tuple(read_names("keys", keys))
        if not (map_px or depth_px or keys):
            raise ValueError("`map_px`, `depth_px` or `keys` must leave something to see, got 0, 0 and none")
        if missing := [key for key in keys if key not in below]:
            raise ValueError(f"`keys` must be observed below, got {', '.join(missing)}")
        if map_px and not has_occupancy(env):
            raise ValueError("`env` must have an occupancy grid; wrap it in OccupancyWrapper first")
        self._map_px: int = map_px
        self._depth_px: int = depth_px
        self._keys: tuple[str, ...] = keys
        self._offsets_m: NDArray[np.float64] = pixel_m * (np.arange(map_px) + 0.5 - 0.5 * map_px)
        images = {"ego_map": (len(MAP_CHANNELS), map_px, map_px), "depth_image": (1, depth_px, depth_px)}
        self.observation_space = spaces.Dict(
            {key: spaces.Box(0, 255, shape, np.uint8) for key, shape in images.items() if shape[1]}
            | {key: below[key] for key in keys}
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._view(observation), info

    def step(self, action: np.int64) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act, and look."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._view(observation), float(reward), terminated, truncated, info

    def _view(self, observation: Observation) -> Observation:
        view = {key: observation[key] for key in self._keys}
        if self._map_px:
            grid = self.get_wrapper_attr("occupancy")
            view["ego_map"] = ego_map(grid, observation["world_from_camera"], self._offsets_m)
        if self._depth_px:
            max_depth_m = self.get_wrapper_attr("camera").max_depth_m
            view["depth_image"] = depth_image(observation["depth"], self._depth_px, max_depth_m)
        return view


def ego_map(
    grid: OccupancyGrid, world_from_camera: NDArray[np.floating], offsets_m: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """Cut the surroundings of the agent out of an occupancy grid.

    Args:
        grid: What is known of the floor.
        world_from_camera: (4, 4) pose of the camera.
        offsets_m: (S,) rising distances of the pixels' centres from the agent, metres.

    Returns:
        (3, S, S) uint8 of `MAP_CHANNELS`, 255 for yes; rows from far ahead to far behind, columns
        from left to right. What is unknown has 0 everywhere.
    """
    heading_rad, frame = heading_of(world_from_camera), grid.frame
    ahead, right = forward_xz(heading_rad), forward_xz(heading_rad - 0.5 * np.pi)
    ahead_m, right_m = -offsets_m[:, None], offsets_m[None, :]
    corner_xz = (world_from_camera[[0, 2], 3] - frame.origin_xz) / frame.cell_m
    column, row = (
        np.floor(corner_xz[axis] + (ahead[axis] * ahead_m + right[axis] * right_m) / frame.cell_m)
        for axis in range(2)
    )
    inside = (row >= 0.0) & (row < frame.shape[0]) & (column >= 0.0) & (column < frame.shape[1])
    flat = np.where(inside, row * frame.shape[1] + column, 0.0).astype(np.int32)
    layers = np.stack([layer.ravel()[flat] for layer in (grid.occupied, grid.free, grid.stood)])
    return np.asarray((layers & inside) * np.uint8(255), np.uint8)


def depth_image(depth_m: NDArray[np.float32], size_px: int, max_depth_m: float) -> NDArray[np.uint8]:
    """Shrink a depth image (H, W, 1), metres, to (1, S, S) bytes; 255 is `max_depth_m`, 0 is empty.

    A pixel is the mean of what is not empty in it.
    """
    depth, size = depth_m[..., 0], (size_px, size_px)
    total = cv2.resize(depth, size, interpolation=cv2.INTER_AREA)
    share = cv2.resize((depth > 0.0).astype(np.float32), size, interpolation=cv2.INTER_AREA)
    mean = np.divide(total, share, out=np.zeros_like(total), where=share > 0.0)
    return np.asarray(np.rint(255.0 / max_depth_m * mean).clip(0, 255), np.uint8)[None]
