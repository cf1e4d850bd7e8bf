"""Environments that step together: all move, one call per scene renders, all judge.

What the vector forms of Gymnasium and Stable-Baselines3 share. They differ in when an episode that
has ended begins anew, so that is left to them.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anm_gym.envs.mesh_env import MeshEnv, Observation
from anm_gym.sim.camera import DepthCamera


@dataclass(frozen=True, eq=False)
class Transition:
    """What one environment returns after a step, or after a reset."""

    observation: Observation
    """The observation."""
    reward: float = 0.0
    """The reward."""
    terminated: bool = False
    """Whether the task ended the episode."""
    truncated: bool = False
    """Whether the step limit did."""
    info: dict[str, Any] | None = None
    """The info."""

    @property
    def has_ended(self) -> bool:
        """Whether the episode is over."""
        return self.terminated or self.truncated


class Lockstep:
    """Step environments together, bit for bit as each alone under a `TimeLimit`.

    Args:
        envs: Bare environments.
        max_episode_steps: Steps after which an episode is truncated, for all or for each; None or, as
            Gymnasium spells it, -1 for never.

    Raises:
        ValueError: If a limit is neither -1 nor at least 1.
    """

    def __init__(self, envs: Sequence[MeshEnv], max_episode_steps: int | Sequence[int] | None) -> None:
        self.envs = tuple(envs)
        limits = np.asarray(-1 if max_episode_steps is None else max_episode_steps, np.int64)
        if ((limits < 1) & (limits != -1)).any():
            raise ValueError(f"`max_episode_steps` must be >= 1, or -1 for no limit, got {max_episode_steps}")
        endless = np.iinfo(np.int64).max
        self._max_steps = np.broadcast_to(np.where(limits == -1, endless, limits), len(envs))

    def reset(self, index: int, seed: int | None = None, options: dict[str, Any] | None = None) -> Transition:
        """Begin an episode in one of the environments; see `MeshEnv.reset`."""
        observation, info = self.envs[index].reset(seed=seed, options=options)
        return Transition(observation, info=info)

    def step(self, indices: Sequence[int], actions: NDArray[np.integer]) -> list[Transition]:
        """Step some of the environments.

        Args:
            indices: Which.
            actions: (len(indices),) their actions.

        Raises:
            ValueError: If an action does not exist.
            ResetNeeded: If an environment has no episode.
        """
        envs = [self.envs[index] for index in indices]
        chosen = [env.action_of(action) for env, action in zip(envs, actions, strict=True)]
        motions = [env.move(action) for env, action in zip(envs, chosen, strict=True)]
        images = render_together(envs)
        transitions = []
        limits = self._max_steps[list(indices)]
        for env, action, motion, depth_m, limit in zip(envs, chosen, motions, images, limits, strict=True):
            observation, reward, terminated, _, info = env.judge(action, motion, depth_m)
            truncated = bool(info["step"] >= limit)
            transitions.append(Transition(observation, reward, terminated, truncated, info))
        return transitions


def render_together(envs: Sequence[MeshEnv]) -> list[NDArray[np.float32]]:
    """Render what every environment sees, with one call for all that share a camera.

    Returns:
        (H, W) float32 depth of each, without noise, metres.
    """
    images: list[NDArray[np.float32]] = [np.empty(0, np.float32)] * len(envs)
    groups: dict[DepthCamera, list[int]] = defaultdict(list)
    for index, env in enumerate(envs):
        groups[env.simulator.camera].append(index)
    for camera, members in groups.items():
        poses = np.stack([envs[index].simulator.world_from_camera for index in members])
        for index, depth_m in zip(members, camera.render(poses), strict=True):
            images[index] = depth_m
    return images
