"""One episode, as the paper tells it: look, decide, move, until the budget is spent; then the score."""

from dataclasses import dataclass, field
from typing import Any, Final, Protocol

import gymnasium as gym
import numpy as np


class Policy(Protocol):
    """Whatever decides: Stable-Baselines3's `predict`, classical agents included."""

    def predict(
        self, observation: Any, state: Any = None, *, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """Choose an action for an observation and hand back the policy's own state."""
        ...


class Recorder:
    """What is written down during an episode; this one writes nothing."""

    def start(self, env: gym.Env, observation: Any, info: dict[str, Any]) -> None:
        """Take note of the first observation, before any action."""

    def step(self, action: int, observation: Any, info: dict[str, Any]) -> None:
        """Take note of an action and of what was seen after it."""

    def scores(self) -> dict[str, Any]:
        """Score the episode; called once, after its last step."""
        return {}


@dataclass(frozen=True)
class EpisodeRecord:
    """What an episode came to."""

    seed: int
    """Seed of the start and of everything drawn in the episode."""
    steps: int
    """Actions taken."""
    total_reward: float
    """Sum of the rewards."""
    terminated: bool
    """Whether the task or the agent ended the episode before the budget was spent."""
    info: dict[str, Any]
    """The last step's `info`."""
    scores: dict[str, Any] = field(default_factory=dict)
    """What the recorder made of the episode."""


NO_RECORDER: Final = Recorder()


def run_episode(
    env: gym.Env,
    policy: Policy,
    seed: int,
    recorder: Recorder = NO_RECORDER,
    start: tuple[float, float, float] | None = None,
) -> EpisodeRecord:
    """Play one episode to its end, from a given start or the one that `seed` draws.

    Args:
        env: An exploration environment with the wrappers that the policy needs, and a step limit.
        policy: Chooses the actions; told of the episode's first step through `episode_start`.
        seed: Seed of `env.reset`: the same seed is the same start for every policy.
        recorder: Listens to every step and makes the scores; by default nothing is recorded.
        start: x, z (metres) and heading (radians) of the first pose.

    Returns:
        The record of the episode.

    Source:
        Active Neural Mapping, Sec. 3: observe, update the map, choose a goal, act.
    """
    observation, info = env.reset(seed=seed, options=None if start is None else {"start": start})
    recorder.start(env, observation, info)
    state, steps, total_reward, terminated, truncated = None, 0, 0.0, False, False
    while not (terminated or truncated):
        is_first = np.array([steps == 0])
        action, state = policy.predict(observation, state=state, episode_start=is_first, deterministic=True)
        observation, reward, terminated, truncated, info = env.step(int(action))
        recorder.step(int(action), observation, info)
        steps, total_reward = steps + 1, total_reward + float(reward)
    return EpisodeRecord(seed, steps, total_reward, bool(terminated), info, recorder.scores())
