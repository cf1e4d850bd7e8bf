"""The recorder that scores an episode: completion from the depth frames, the trail, compute by module."""

import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from anm_gym.metrics.completion import CompletionMeter
from anm_gym.stopwatch import Stopwatch
from train.runner import Recorder
from train.trajectory import Trajectory

Progress = Callable[[float], None]
"""Told after each step of the completion ratio so far, per cent."""


class SimulatorClock(gym.Wrapper):
    """Charge the bare environment's steps, which render and move, to the module `render`."""

    def __init__(self, env: gym.Env) -> None:
        """Put the clock around an environment, under all other wrappers."""
        super().__init__(env)
        self._stopwatch = Stopwatch()

    @property
    def compute_ms(self) -> dict[str, float]:
        """Total CPU milliseconds."""
        return self._stopwatch.compute_ms

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode and count from zero."""
        self._stopwatch.reset()
        with self._stopwatch("render"):
            return self.env.reset(seed=seed, options=options)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step the environment on the clock."""
        with self._stopwatch("render"):
            return self.env.step(action)


def env_layers(env: gym.Env) -> Iterator[gym.Env]:
    """Walk from the outermost wrapper to the environment itself."""
    while isinstance(env, gym.Wrapper):
        yield env
        env = env.env
    yield env


def find_attribute(env: gym.Env, name: str) -> Any:
    """Get an attribute from whichever layer has it; None if none has."""
    return env.get_wrapper_attr(name) if env.has_wrapper_attr(name) else None


class GoalLog:
    """What was added to a growing list of goals, and when."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self.reasons: list[str] = []
        self._places: list[tuple[float, float, int]] = []

    def extend(self, goals: Sequence[Any], step: int) -> None:
        """Take note of the goals that were added to the list since the last call."""
        for goal in goals[len(self._places) :]:
            x, z = goal.position_xz
            self._places.append((float(x), float(z), step))
            self.reasons.append(str(getattr(goal, "reason", "")))

    def places(self) -> NDArray[np.float64]:
        """(G, 3) x, z (metres) and step of each goal."""
        return np.array(self._places, np.float64).reshape(-1, 3)


class EpisodeRecorder(Recorder):
    """Feed every depth frame to a completion meter and keep the trail, the goals and the CPU time.

    The time that the recorder itself takes is left out of `cpu_ms`.
    """

    def __init__(self, meter: CompletionMeter, policy: Any = None, progress: Progress | None = None) -> None:
        """Listen to one episode.

        Args:
            meter: A fresh meter for the scene.
            policy: Its `compute_ms`, if it has one, joins the wrappers'.
            progress: Told after each step.
        """
        self.meter = meter
        self._policy = policy
        self._progress = progress or _show_nothing
        self._actions: list[int] = []
        self._collisions: list[int] = []
        self._goals = GoalLog()
        self._failures = GoalLog()
        self._cpu_s = 0.0
        self._mark_s = time.process_time()

    def start(self, env: gym.Env, observation: Any, info: dict[str, Any]) -> None:
        """Begin with the first frame; the reset is charged to the agent as well."""
        self._env = env
        self._camera = env.get_wrapper_attr("camera")
        self._take(observation, info)

    def step(self, action: int, observation: Any, info: dict[str, Any]) -> None:
        """Charge the time since the last frame to the agent, then score the new frame."""
        self._actions.append(action)
        self._take(observation, info)
        self._progress(self.meter.comp_pct)
        self._mark_s = time.process_time()

    def scores(self) -> dict[str, Any]:
        """Compute by module; the measures of the trail are read from `trajectory` and `meter`."""
        return {"cpu_ms": self.cpu_ms()}

    def cpu_ms(self) -> dict[str, float]:
        """CPU milliseconds per step by module, with the `total` and what no module claims as `other`."""
        steps = max(len(self._actions), 1)
        modules: dict[str, float] = {}
        for owner in (*env_layers(self._env), self._policy):
            for module, total_ms in getattr(owner, "compute_ms", {}).items():
                modules[module] = modules.get(module, 0.0) + total_ms / steps
        total = 1000.0 * self._cpu_s / steps
        modules["other"] = max(total - sum(modules.values()), 0.0)
        return {**{name: round(value, 4) for name, value in modules.items()}, "total": round(total, 4)}

    def trajectory(self, scene: str, seed: int, env_options: dict[str, Any]) -> Trajectory:
        """Gather what replays the episode, with the curves of completion and collisions."""
        states = find_attribute(self._env, "trajectory")
        poses = np.array([[*state.position_xz, state.heading_rad] for state in states])
        curves = {
            "comp_pct": np.asarray(self.meter.curve_pct, np.float64),
            "collisions": np.array(self._collisions, np.float64),
        }
        return Trajectory(
            scene,
            seed,
            np.array(self._actions, np.int8),
            poses,
            env_options,
            self._goals.places(),
            curves,
            self._env.get_wrapper_attr("scene").mesh.content_hash,
            tuple(self._goals.reasons),
            self._failures.places(),
            tuple(self._failures.reasons),
            self._env.get_wrapper_attr("scene").storey_mesh.areas_m2.sum(),
        )

    def _take(self, observation: Any, info: dict[str, Any]) -> None:
        self._cpu_s += time.process_time() - self._mark_s
        self._collisions.append(int(info["collisions"]))
        self._goals.extend(find_attribute(self._env, "goals") or [], len(self._actions))
        self._failures.extend(find_attribute(self._env, "failures") or [], len(self._actions))
        self.meter.observe(observation["depth"], self._camera, observation["world_from_camera"])
        self._mark_s = time.process_time()


def _show_nothing(_comp_pct: float) -> None:
    """Stand in where no progress is shown."""
