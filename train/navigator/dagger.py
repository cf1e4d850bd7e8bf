"""Imitation of the teacher on the states that the student meets (DAgger): the first stage of training."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.navigator_net import NavigatorNet, State
from anm_gym.actions import Action
from anm_gym.checks import check_at_least, check_positive, check_share
from train.navigator.env import NavigationVecEnv
from train.navigator.ranks import Ranks

STOP: Final = int(Action.STOP)


@dataclass(frozen=True)
class DaggerSettings:
    """How the student imitates."""

    frames: int = 160_000
    """Frames of this stage, over all processes."""
    teacher_frames: int = 60_000
    """Frames over which the share of the teacher's actions falls from 1 to 0."""
    rollout_steps: int = 32
    """Steps of every agent between two rounds of learning."""
    capacity_steps: int = 8_000
    """Steps of every agent that are kept."""
    segment_steps: int = 32
    """Length of the sequences that are learned from."""
    segments: int = 16
    """Sequences of a gradient step."""
    updates_per_rollout: int = 4
    """Gradient steps of a round."""
    learning_rate: float = 7e-4
    """Of Adam at the start; it falls linearly."""
    last_rate_share: float = 0.05
    """Share of the learning rate that is left at the end."""
    stop_weight: float = 2.0
    """Weight of frames in which the teacher stops."""
    max_grad_norm: float = 1.0
    """Gradients are clipped to this norm."""

    def __post_init__(self) -> None:
        check_at_least(self, 0, "frames", "teacher_frames", "stop_weight")
        check_at_least(self, 1, "rollout_steps", "segment_steps", "segments", "updates_per_rollout")
        check_positive(self, "learning_rate", "max_grad_norm")
        check_share(self, "last_rate_share")
        if not self.capacity_steps >= self.segment_steps:
            raise ValueError(
                f"`capacity_steps` must be >= `segment_steps`, got {self.capacity_steps} and "
                f"{self.segment_steps}"
            )


@final
class Replay:
    """What the agents saw last, in the order in which they saw it.

    Args:
        capacity_steps: Steps of every agent that are kept.
        first: The first observation of all agents; its keys, shapes and dtypes are those of the rest.
        state: A state of the LSTM of all agents.
    """

    def __init__(self, capacity_steps: int, first: dict[str, NDArray[Any]], state: State) -> None:
        self.observations = {
            key: np.empty((capacity_steps, *values.shape), values.dtype) for key, values in first.items()
        }
        layers, agents, size = state[0].shape
        self.labels = np.empty((capacity_steps, agents), np.uint8)
        self.starts = np.empty((capacity_steps, agents), np.float32)
        self.states = np.empty((capacity_steps, 2, layers, agents, size), np.float16)
        self._capacity, self._agents, self.steps = capacity_steps, agents, 0

    def add(
        self,
        observation: dict[str, NDArray[Any]],
        labels: NDArray[np.integer],
        starts: NDArray[np.bool_],
        state: State,
    ) -> None:
        """Add one step of all agents; the state is the one before it."""
        place = self.steps % self._capacity
        for key, values in observation.items():
            self.observations[key][place] = values
        self.labels[place], self.starts[place] = labels, starts
        self.states[place] = torch.stack(state).cpu().numpy()
        self.steps += 1

    def sample(
        self, segments: int, length: int, rng: np.random.Generator
    ) -> tuple[dict[str, Tensor], Tensor, State, Tensor]:
        """Draw sequences of neighbouring steps.

        Returns:
            Observations, labels (B,), states before the first steps and starts (B,), with B = segments *
            length and the steps of a sequence side by side.
        """
        kept = min(self.steps, self._capacity)
        oldest = self.steps - kept
        first = oldest + rng.integers(kept - length + 1, size=segments)
        agent = rng.integers(self._agents, size=segments)
        place = ((first[:, None] + np.arange(length)) % self._capacity).ravel()
        who = np.repeat(agent, length)
        observations = {
            key: torch.from_numpy(values[place, who]) for key, values in self.observations.items()
        }
        before = self.states[first % self._capacity, :, :, agent].astype(np.float32)
        hidden, cell = torch.from_numpy(before).permute(1, 2, 0, 3).contiguous()
        labels = torch.from_numpy(self.labels[place, who].astype(np.int64))
        return observations, labels, (hidden, cell), torch.from_numpy(self.starts[place, who])


@dataclass(frozen=True)
class Round:
    """What one round of imitation came to."""

    frames: int
    """Frames so far, over all processes."""
    loss: float
    """Mean cross-entropy of the round."""
    agreement: float
    """Share of the student's choices that were the teacher's, while collecting."""
    episodes: tuple[dict[str, Any], ...]
    """Last info of the episodes that ended."""


@final
class Dagger:
    """Collect with a mixture of student and teacher, learn from what the teacher would have done.

    Args:
        net: The student.
        env: Where it acts.
        settings: How.
        seed: Seeds the mixture and the draws from the replay.
        ranks: The processes that learn together.

    Source:
        Ross et al., 2011. Recurrent states are kept with the frames, as in R2D2.
    """

    def __init__(
        self,
        net: NavigatorNet,
        env: NavigationVecEnv,
        settings: DaggerSettings,
        seed: int = 0,
        ranks: Ranks | None = None,
    ) -> None:
        self.net, self.env, self.settings = net, env, settings
        self.optimizer = torch.optim.Adam(net.parameters(), lr=settings.learning_rate)
        self.frames = 0
        self._ranks = ranks or Ranks()
        self._rng = np.random.default_rng([seed, self._ranks.rank])
        self._device = next(net.parameters()).device
        weights = torch.ones(len(Action))
        weights[STOP] = settings.stop_weight
        self._loss = nn.CrossEntropyLoss(weights.to(self._device))

    def rounds(self) -> Iterator[Round]:
        """Learn until the budget of frames is spent; yields after every round."""
        self._ranks.synchronise(self.net)
        observation: Any = self.env.reset()
        state = self.net.first_state(self.env.num_envs)
        starts = np.ones(self.env.num_envs, bool)
        replay = Replay(self.settings.capacity_steps, observation, state)
        while self.frames < self.settings.frames:
            agreed, episodes = 0.0, []
            for _ in range(self.settings.rollout_steps):
                before = state
                choice, state = self._choose(observation, state, starts)
                labels = self.env.teacher_actions()
                replay.add(observation, labels, starts, before)
                agreed += float((choice == labels).mean())
                observation, _, starts, infos = self.env.step(self._mix(choice, labels))
                episodes += [info for info, ended in zip(infos, starts, strict=True) if ended]
            self.frames += int(self._ranks.world * self.settings.rollout_steps * self.env.num_envs)
            loss = self._learn(replay)
            yield Round(self.frames, loss, agreed / self.settings.rollout_steps, tuple(episodes))

    @property
    def teacher_share(self) -> float:
        """Share of the teacher's actions now."""
        all_frames = self.settings.teacher_frames
        return max(0.0, 1.0 - self.frames / all_frames) if all_frames else 0.0

    @torch.no_grad()
    def _choose(
        self, observation: dict[str, NDArray[Any]], state: State, starts: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], State]:
        """Sample the student's actions."""
        tensors = {key: torch.from_numpy(values).to(self._device) for key, values in observation.items()}
        begins = torch.from_numpy(starts.astype(np.float32)).to(self._device)
        outputs, state = self.net.step(tensors, state, begins)
        noise = self._rng.gumbel(size=outputs.logits.shape)
        return (outputs.logits.cpu().numpy() + noise).argmax(axis=1).astype(np.int64), state

    def _mix(self, choice: NDArray[np.int64], labels: NDArray[np.int64]) -> NDArray[np.int64]:
        """What is carried out: the student's choice, or the teacher's; never a stop too early."""
        is_taught = self._rng.random(len(choice)) < self.teacher_share
        return np.where(is_taught | ((choice == STOP) & (labels != STOP)), labels, choice)

    def _learn(self, replay: Replay) -> float:
        settings = self.settings
        self._set_learning_rate()
        if replay.steps < settings.segment_steps:
            return float("nan")
        losses = []
        for _ in range(settings.updates_per_rollout):
            sample = replay.sample(settings.segments, settings.segment_steps, self._rng)
            observation, labels, state, starts = _on(self._device, *sample)
            loss = self._loss(self.net(observation, state, starts).logits, labels)
            self.optimizer.zero_grad()
            loss.backward()
            self._ranks.average_gradients(self.net.parameters())
            nn.utils.clip_grad_norm_(self.net.parameters(), settings.max_grad_norm)
            self.optimizer.step()
            losses.append(float(loss.detach()))
        return float(np.mean(losses))

    def _set_learning_rate(self) -> None:
        done = min(1.0, self.frames / self.settings.frames)
        share = 1.0 - done * (1.0 - self.settings.last_rate_share)
        for group in self.optimizer.param_groups:
            group["lr"] = self.settings.learning_rate * share


def _on(
    device: torch.device, observation: dict[str, Tensor], labels: Tensor, state: State, starts: Tensor
) -> tuple[dict[str, Tensor], Tensor, State, Tensor]:
    """What `Replay.sample` draws, moved to where the network lives."""
    moved = {key: values.to(device) for key, values in observation.items()}
    hidden, cell = state
    return moved, labels.to(device), (hidden.to(device), cell.to(device)), starts.to(device)
