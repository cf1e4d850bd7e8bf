"""What Explore and PointNav share: a scene, an agent in it, and what the agent observes."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from anm_gym.actions import FORWARD_STEP_M, TURN_STEP_DEG, Action
from anm_gym.envs.drawing import draw_status
from anm_gym.envs.noise import NoiseSpec
from anm_gym.errors import EpisodeError
from anm_gym.geometry import CameraSpec, forward_xz, wrap_angle
from anm_gym.scenes.catalog import make_scene
from anm_gym.scenes.scene import Scene
from anm_gym.sim.simulator import AgentState, Simulator

Observation = dict[str, NDArray[Any]]
OPTIONS = frozenset({"scene", "start"})
_FLOAT_MAX = float(np.finfo(np.float32).max)


class MeshEnv(gymnasium.Env[Observation, np.int64], ABC):
    """An agent with a depth camera on one storey of a mesh; subclasses add the task."""

    metadata = {"render_modes": ["rgb_array", "depth_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        scene: str = "home:flat:0",
        *,
        scene_options: dict[str, Any] | None = None,
        camera: dict[str, Any] | None = None,
        forward_step_m: float = FORWARD_STEP_M,
        turn_step_deg: float = TURN_STEP_DEG,
        start: Sequence[float] | None = None,
        noise: dict[str, float] | None = None,
        backend: str = "embree",
        device: str = "cpu",
        rgb: bool = False,
        render_mode: str | None = None,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(
                f"`render_mode` must be one of {self.metadata['render_modes']}, got {render_mode!r}"
            )
        self.render_mode = render_mode
        self.camera = CameraSpec(**(camera or {}))
        self._noise = NoiseSpec(**(noise or {}))
        self._start, self._rgb = start, rgb
        self._scene_options = dict(scene_options or {})
        self._motion = {"forward_step_m": forward_step_m, "turn_step_deg": turn_step_deg}
        self._backend = {"backend": backend, "device": device}
        self._bind(scene)
        self.action_space = spaces.Discrete(len(Action))
        self.observation_space = spaces.Dict(self._spaces())
        self.trajectory: list[AgentState] = []
        self.collisions, self.path_length_m = 0, 0.0

    @property
    def scene(self) -> Scene:
        """The scene of the current episode."""
        return self._scene

    @property
    def simulator(self) -> Simulator:
        """The agent in its scene."""
        return self._simulator

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Seeds every draw of this and the following episodes.
            options: ``scene`` (a scene's name or path) and ``start`` (x, z, heading in metres and
                radians) of this episode.

        Returns:
            The first observation and info.

        Raises:
            ValueError: If an option is unknown.
            SceneError: If the scene cannot be used.
            EpisodeError: If the start is not navigable.
        """
        super().reset(seed=seed)
        options = options or {}
        if unknown := set(options) - OPTIONS:
            raise ValueError(f"unknown options {sorted(unknown)}; choose among: {sorted(OPTIONS)}")
        self._bind(options.get("scene", self._scene_name))
        self._place(options.get("start", self._start))
        self.trajectory = [self._simulator.state]
        self.collisions, self.path_length_m = 0, 0.0
        self._begin()
        return self._observe(), self._info(collided=False)

    def step(self, action: np.int64) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Carry out one action; see the class for rewards and the end of an episode."""
        if not self.trajectory:
            raise EpisodeError("the episode must have begun; call `reset` first")
        forward_scale, turn_offset_rad = self._noise.draw_actuation(self.np_random)
        motion = self._simulator.act(
            int(action), forward_scale=forward_scale, turn_offset_rad=turn_offset_rad
        )
        self.trajectory.append(self._simulator.state)
        self.collisions += int(motion.collided)
        self.path_length_m += motion.travelled_m
        reward, terminated = self._judge(Action(action))
        return self._observe(), reward, terminated, False, self._info(collided=motion.collided)

    def render(self) -> NDArray[Any] | None:  # type: ignore[override]
        """Draw the top-down map, the trail and the depth image, or return the depth in metres."""
        if self.render_mode is None or not self.trajectory:
            return None
        if self.render_mode == "depth_array":
            return self._simulator.depth_m()
        return draw_status(self._simulator, self.trajectory, self._goal_xz(), self._caption())

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what is rebuilt from the scene's name."""
        state = self.__dict__.copy()
        state.pop("_simulator")
        state.pop("_scene")
        state["_agent"] = self._simulator.state if self.trajectory else None
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Rebuild the scene and the simulator."""
        agent = state.pop("_agent")
        name = state.pop("_scene_name")
        self.__dict__.update(state)
        self._bind(name)
        if agent is not None:
            self._simulator.place(agent.position_xz, agent.heading_rad)

    @abstractmethod
    def _begin(self) -> None:
        """Set up the task of a new episode; the agent has been placed."""

    @abstractmethod
    def _judge(self, action: Action) -> tuple[float, bool]:
        """Reward and termination after an action."""

    @abstractmethod
    def _task_spaces(self) -> dict[str, spaces.Space[Any]]:
        """Spaces of the task's own observations."""

    @abstractmethod
    def _task_observation(self) -> Observation:
        """The task's own observations."""

    @abstractmethod
    def _task_info(self) -> dict[str, Any]:
        """The task's own info, plain scalars."""

    @abstractmethod
    def _goal_xz(self) -> NDArray[np.float64] | None:
        """Where the goal is, for pictures."""

    def _bind(self, scene_name: str) -> None:
        """Load the scene unless it is at hand."""
        if scene_name == self.__dict__.get("_scene_name") and "_simulator" in self.__dict__:
            return
        self._scene = _load(scene_name, tuple(sorted(self._scene_options.items())))
        self._simulator = Simulator(
            self._scene.mesh, self._scene.floor_y_m, self.camera, **self._motion, **self._backend
        )
        self._scene_name = scene_name

    def _place(self, start: Sequence[float] | None) -> None:
        if start is None:
            position = self._simulator.grid.sample_position(self.np_random)
            self._simulator.place(position, float(self.np_random.uniform(-np.pi, np.pi)))
            return
        if len(start) != 3:
            raise ValueError(f"`start` must be (x, z, heading_rad), got {start!r}")
        self._simulator.place(start[:2], float(start[2]))

    def _spaces(self) -> dict[str, spaces.Space[Any]]:
        height, width = self.camera.height_px, self.camera.width_px
        shared: dict[str, spaces.Space[Any]] = {
            "depth": spaces.Box(0.0, self.camera.max_depth_m, (height, width, 1), np.float32),
            "gps": spaces.Box(-_FLOAT_MAX, _FLOAT_MAX, (2,), np.float32),
            "compass": spaces.Box(-np.pi, np.pi, (1,), np.float32),
            "world_from_camera": spaces.Box(-_FLOAT_MAX, _FLOAT_MAX, (4, 4), np.float32),
        }
        if self._rgb:
            shared["rgb"] = spaces.Box(0, 255, (height, width, 3), np.uint8)
        return shared | self._task_spaces()

    def _observe(self) -> Observation:
        depth = self._noise.disturb(self._simulator.depth_m(), self.np_random)
        depth = np.minimum(depth, np.float32(self.camera.max_depth_m))
        start, now = self.trajectory[0], self._simulator.state
        delta = now.position_xz - start.position_xz
        ahead = forward_xz(start.heading_rad)
        right = np.array([-ahead[1], ahead[0]])
        turned = wrap_angle(now.heading_rad - start.heading_rad)
        observation: Observation = {
            "depth": depth[..., None],
            "gps": np.array([delta @ ahead, delta @ right], np.float32),
            "compass": np.array([turned], np.float32).clip(-np.pi, np.pi).astype(np.float32),
            "world_from_camera": self._simulator.world_from_camera.astype(np.float32),
        }
        if self._rgb:
            observation["rgb"] = self._simulator.rgb()
        return observation | self._task_observation()

    def _info(self, *, collided: bool) -> dict[str, Any]:
        shared = {
            "collided": collided,
            "collisions": self.collisions,
            "path_length_m": float(self.path_length_m),
            "step": len(self.trajectory) - 1,
        }
        return shared | self._task_info()

    def _caption(self) -> str:
        return f"step {len(self.trajectory) - 1}   {self.path_length_m:.1f} m   {self.collisions} collisions"


@lru_cache(maxsize=4)
def _load(name: str, options: tuple[tuple[str, Any], ...]) -> Scene:
    """Share a scene among the environments of a process."""
    return make_scene(name, **dict(options))
