"""Recorded walks: the same posed depth images for every map that is to be compared."""

from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from agents.roster import build_agent
from anm_gym.geometry import CameraSpec
from anm_gym.scenes.scene import Scene
from train.command import scene_label
from train.episodes import make_env, scene_of
from train.runner import Recorder, run_episode


@dataclass(frozen=True, eq=False)
class Recording:
    """T posed depth images of one walk through a scene."""

    name: str
    """Label of the scene, and the seed of the walk."""
    seed: int
    """Seed of the walk."""
    scene: Scene
    """What the walk went through."""
    camera: CameraSpec
    """The camera of every image."""
    depth_m: NDArray[np.float32]
    """(T, H, W) planar depth, metres; 0 is empty."""
    world_from_camera: NDArray[np.float64]
    """(T, 4, 4) poses."""

    def __len__(self) -> int:
        return len(self.depth_m)


class _FrameRecorder(Recorder):
    """Keep every observation's depth and pose."""

    def __init__(self) -> None:
        self.depth_m: list[NDArray[np.float32]] = []
        self.poses: list[NDArray[np.float64]] = []

    def start(self, env: gym.Env, observation: Any, info: dict[str, Any]) -> None:  # noqa: ARG002
        self._keep(observation)

    def step(self, action: int, observation: Any, info: dict[str, Any]) -> None:  # noqa: ARG002
        self._keep(observation)

    def _keep(self, observation: Any) -> None:
        self.depth_m.append(observation["depth"][..., 0])
        self.poses.append(observation["world_from_camera"].astype(np.float64))


def record(scene: str, steps: int, seed: int = 0, agent: str = "fbe:strong") -> Recording:
    """Walk through a scene with an agent that has no neural map.

    Args:
        scene: A path or a procedural name.
        steps: Images to record.
        seed: Seed of the start.
        agent: An agent of the roster; the default explores, so that old and new surface alternate.

    Returns:
        The recording; the same arguments give the same bits.
    """
    env = make_env(scene, steps - 1, {})
    walker = build_agent(agent, env, seed)
    recorder = _FrameRecorder()
    run_episode(walker.env, walker.policy, seed, recorder)
    recording = Recording(
        name=f"{scene_label(scene)}-{seed}",
        seed=seed,
        scene=scene_of(env),
        camera=env.get_wrapper_attr("camera"),
        depth_m=np.stack(recorder.depth_m),
        world_from_camera=np.stack(recorder.poses),
    )
    walker.env.close()
    return recording
