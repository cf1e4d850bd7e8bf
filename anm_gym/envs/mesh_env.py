"""What Explore and PointNav share: a scene, an agent in it, and what the agent observes."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from anm_gym.actions import Action
from anm_gym.envs.largest_part import LARGEST, nearest_place
from anm_gym.envs.noise import NoiseSpec
from anm_gym.envs.options import EpisodeOptions, MeshEnvSettings, read_numbers
from anm_gym.envs.picture import Moment, draw_moment
from anm_gym.envs.shared_scenes import shared_scene, shared_simulator
from anm_gym.errors import EpisodeError
from anm_gym.geometry import CameraSpec, forward_xz, wrap_angle
from anm_gym.scenes.scene import Scene
from anm_gym.sim.motion import Motion
from anm_gym.sim.simulator import AgentState, Simulator

Observation = dict[str, NDArray[Any]]
UNBOUNDED = float(np.finfo(np.float32).max)


class MeshEnv(gymnasium.Env[Observation, np.int64], ABC):
    """An agent with a depth camera on one storey of a mesh; subclasses add the task.

    Everything random is drawn from `np_random`, so settings, seed and options decide an episode bit
    for bit. An environment can be pickled and copied deeply in the middle of an episode: the scene is
    made again from its name.

    Args:
        settings: The settings that all environments share.

    Raises:
        ValueError: If a setting is out of its range.
        SceneError: If the scene cannot be used.
        BackendError: If the back end that casts the rays is missing.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array", "depth_array"], "render_fps": 15}  # type: ignore[misc]

    def __init__(self, settings: MeshEnvSettings) -> None:
        if settings.render_mode not in {None, *self.metadata["render_modes"]}:
            raise ValueError(
                f"`render_mode` must be one of {self.metadata['render_modes']} or None, "
                f"got {settings.render_mode!r}"
            )
        self.settings = settings
        self.render_mode = settings.render_mode
        self.camera = CameraSpec(**(settings.camera or {}))
        self.noise = NoiseSpec(**(settings.noise or {}))
        self._start = read_numbers("start", settings.start, ("x", "z", "heading_rad"))
        self._bind(settings.scene)
        self.action_space = spaces.Discrete(len(Action))
        self.observation_space = spaces.Dict(self._shared_spaces() | self._task_spaces())  # type: ignore[assignment]
        self.trajectory: list[AgentState] = []
        """Where the agent has been since `reset`; one more than there were steps."""
        self.collisions, self.path_length_m = 0, 0.0

    @property
    def scene(self) -> Scene:
        """The scene of the current episode."""
        return self._scene

    @property
    def simulator(self) -> Simulator:
        """The agent in its scene."""
        return self._simulator

    @property
    def step_sizes(self) -> tuple[float, float]:
        """Length of the agent's forward step, metres, and angle of its turn, radians."""
        return self._simulator.forward_step_m, self._simulator.turn_step_rad

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Seeds every draw of this and the following episodes.
            options: For this episode only: ``scene`` (a name or path), ``start`` (x, z in metres,
                heading in radians), and ``goal`` (x, z) where there is one.

        Returns:
            The first observation and info.

        Raises:
            ValueError: If an option is unknown or malformed, or the camera is above the scene's ceiling.
            SceneError: If the scene cannot be used.
            EpisodeError: If start or goal is not on the largest navigable part of the storey, or no goal
                lies at the distance that is asked for.
        """
        super().reset(seed=seed)
        asked = EpisodeOptions.read(options, self._option_names())
        self.trajectory = []
        self.collisions, self.path_length_m = 0, 0.0
        self._bind(asked.scene or self.settings.scene)
        self._place(self._start if asked.start is None else asked.start)
        depth_m = self._simulator.depth_m()
        self._look(depth_m)
        self._begin(asked, depth_m)
        self.trajectory.append(self._simulator.state)
        return self._observe(), self._info(collided=False)

    def step(self, action: np.int64) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Carry out one action; the class tells of rewards and the end of an episode.

        Raises:
            ValueError: If there is no such action.
            ResetNeeded: Before the first `reset`.
        """
        chosen = self.action_of(action)
        motion = self.move(chosen)
        return self.judge(chosen, motion, self._simulator.depth_m())

    def action_of(self, number: np.int64) -> Action:
        """Read the number of an action.

        Raises:
            ValueError: If there is no such action.
        """
        if not self.action_space.contains(number):
            raise ValueError(f"`action` must be one of {[int(a) for a in Action]}, got {number!r}")
        return Action(int(number))

    def move(self, action: Action) -> Motion:
        """Carry out the first half of a step: the motion.

        The halves are apart for vectorised environments, which render between them all at once.

        Raises:
            ResetNeeded: If no episode has begun.
        """
        if not self.trajectory:
            raise gymnasium.error.ResetNeeded("no episode has begun; call `reset` first")
        forward_m, turn_rad = self.noise.draw_actuation(self.np_random)
        scale = 1.0 + forward_m / self.settings.forward_step_m
        motion = self._simulator.act(action, forward_scale=scale, turn_offset_rad=turn_rad)
        self.trajectory.append(self._simulator.state)
        self.collisions += int(motion.collided)
        self.path_length_m += float(motion.travelled_m)
        return motion

    def judge(
        self, action: Action, motion: Motion, depth_m: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Carry out the second half of a step: what is seen and what it is worth.

        Args:
            action: The action of `move`.
            motion: What came of it.
            depth_m: (H, W) float32 depth from where the agent is now, without noise, metres.

        Returns:
            As `step`.
        """
        self._look(depth_m)
        reward, terminated = self._judge(action, depth_m)
        return self._observe(), reward, terminated, False, self._info(collided=motion.collided)

    def render(self) -> NDArray[Any] | None:
        """Draw the storey with the trail beside the depth image, or return the depth image.

        Returns:
            `rgb_array`: (540, 960, 3) uint8. `depth_array`: (H, W) float32 metres as observed, 0 is
            empty. None without a render mode.
        """
        if self.render_mode is None:
            gymnasium.logger.warn("`render` draws nothing without a `render_mode`; give one to `make`")
            return None
        if not self.trajectory:
            raise gymnasium.error.ResetNeeded("there is nothing to draw yet; call `reset` first")
        if self.render_mode == "depth_array":
            return self._depth_m.copy()
        return draw_moment(self._scene, self._moment())

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what is made again from the scene's name."""
        state = self.__dict__.copy()
        del state["_simulator"], state["_scene"]
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make scene and simulator again and put the agent back."""
        name = state.pop("_scene_name")
        self.__dict__.update(state)
        self._bind(name)
        if self.trajectory:
            self._simulator.place(self.trajectory[-1].position_xz, self.trajectory[-1].heading_rad)

    @abstractmethod
    def _option_names(self) -> tuple[str, ...]:
        """Options that `reset` takes."""

    @abstractmethod
    def _begin(self, options: EpisodeOptions, depth_m: NDArray[np.float32]) -> None:
        """Set up the task; the agent has been placed and sees `depth_m` (H, W), without noise."""

    @abstractmethod
    def _judge(self, action: Action, depth_m: NDArray[np.float32]) -> tuple[float, bool]:
        """Reward and termination after an action; the agent sees `depth_m` (H, W), without noise."""

    @abstractmethod
    def _task_spaces(self) -> dict[str, spaces.Space[Any]]:
        """Spaces of the task's own observations."""

    @abstractmethod
    def _task_observation(self) -> Observation:
        """The task's own observations, new arrays."""

    @abstractmethod
    def _task_info(self) -> dict[str, Any]:
        """The task's own info, plain scalars."""

    @abstractmethod
    def _moment(self) -> Moment:
        """What `render` draws."""

    def _bind(self, scene_name: str) -> None:
        """Put a scene in place unless it is there already."""
        scene = shared_scene(scene_name, self.settings.scene_options)
        if scene is not self.__dict__.get("_scene"):
            settings = self.settings
            self._check_camera(scene)
            self._simulator = shared_simulator(
                scene,
                self.camera,
                backend=settings.backend,
                device=settings.device,
                forward_step_m=settings.forward_step_m,
                turn_step_deg=settings.turn_step_deg,
            )
        self._scene, self._scene_name = scene, scene_name

    def _check_camera(self, scene: Scene) -> None:
        """Refuse a camera that would look at the scene from above its ceiling."""
        height_m, ceiling_y_m = self.camera.sensor_height_m, scene.ceiling_y_m
        if ceiling_y_m is not None and height_m >= ceiling_y_m - scene.floor_y_m:
            raise ValueError(
                f"`sensor_height_m` must be below the ceiling of {scene.name}, "
                f"{ceiling_y_m - scene.floor_y_m:.2f} m above its floor, got {height_m}"
            )

    def _place(self, start: NDArray[np.float64] | None) -> None:
        if start is None:
            position_xz = self._simulator.grid.sample_position(self.np_random)
            heading_rad = float(self.np_random.uniform(-np.pi, np.pi))
        else:
            position_xz, heading_rad = start[:2], float(start[2])
            self._require_largest_part("start", position_xz)
        self._simulator.place(position_xz, heading_rad)

    def _require_largest_part(self, name: str, position_xz: NDArray[np.float64]) -> None:
        """Refuse a place from where most of the storey, or nothing of it, can be reached.

        Raises:
            EpisodeError: If the place is not on the largest navigable part.
        """
        grid = self._simulator.grid
        part = grid.component_at(position_xz)
        if part == LARGEST:
            return
        nearest_xz = nearest_place(grid, position_xz)
        nearest = "nowhere" if nearest_xz is None else np.round(nearest_xz, 3).tolist()
        place = f"on a part of {grid.component_areas_m2[part - 1]:.2f} m2" if part else "not navigable"
        raise EpisodeError(
            f"`{name}` must be on the largest navigable part of the storey, got x, z = "
            f"{np.round(position_xz, 3).tolist()}, which is {place}"
            f"; the nearest of it is {nearest}"
        )

    def _look(self, depth_m: NDArray[np.float32]) -> None:
        """Keep what is observed of a true depth image."""
        self._depth_m = self.noise.disturb(depth_m, self.camera.max_depth_m, self.np_random)

    def _shared_spaces(self) -> dict[str, spaces.Space[Any]]:
        height, width = self.camera.height_px, self.camera.width_px
        shared: dict[str, spaces.Space[Any]] = {
            "depth": spaces.Box(0.0, self.camera.max_depth_m, (height, width, 1), np.float32),
            "gps": spaces.Box(-UNBOUNDED, UNBOUNDED, (2,), np.float32),
            "compass": spaces.Box(-np.pi, np.pi, (1,), np.float32),
            "world_from_camera": spaces.Box(-UNBOUNDED, UNBOUNDED, (4, 4), np.float32),
        }
        if self.settings.rgb:
            shared["rgb"] = spaces.Box(0, 255, (height, width, 3), np.uint8)
        return shared

    def _observe(self) -> Observation:
        start, now = self.trajectory[0], self._simulator.state
        observation: Observation = {
            "depth": self._depth_m[..., None].copy(),
            "gps": _gps(start, now),
            "compass": np.array([wrap_angle(now.heading_rad - start.heading_rad)], np.float32),
            "world_from_camera": self._simulator.world_from_camera.astype(np.float32),
        }
        if self.settings.rgb:
            observation["rgb"] = self._simulator.rgb()
        return observation | self._task_observation()

    def _info(self, *, collided: bool) -> dict[str, Any]:
        shared = {
            "collided": collided,
            "collisions": self.collisions,
            "path_length_m": self.path_length_m,
            "step": len(self.trajectory) - 1,
        }
        return shared | self._task_info()

    def _captions(self) -> Mapping[str, str]:
        """What the picture says of every episode."""
        return {
            "step": str(len(self.trajectory) - 1),
            "path": f"{self.path_length_m:.1f} m",
            "collisions": str(self.collisions),
        }


def _gps(start: AgentState, now: AgentState) -> NDArray[np.float32]:
    """(2,) metres ahead and to the right of the start, as Habitat's episodic GPS."""
    delta = now.position_xz - start.position_xz
    ahead = forward_xz(start.heading_rad)
    return np.array([delta @ ahead, delta[1] * ahead[0] - delta[0] * ahead[1]], np.float32)
