"""The rollouts of a recurrent learner, handed out by environment and without padding."""

from collections.abc import Iterator
from typing import Any, Final, final

import numpy as np
from sb3_contrib.common.recurrent.buffers import RecurrentDictRolloutBuffer
from sb3_contrib.common.recurrent.type_aliases import RecurrentDictRolloutBufferSamples, RNNStates
from torch import Tensor

from train.navigator.ranks import Ranks

STEP_ARRAYS: Final = ("actions", "rewards", "returns", "episode_starts", "values", "log_probs", "advantages")
"""Arrays with a first axis for the steps."""
STATE_ARRAYS: Final = ("hidden_states_pi", "cell_states_pi")


@final
class EnvironmentBuffer(RecurrentDictRolloutBuffer):
    """Minibatches of whole environments, as DD-PPO has them.

    The library cuts minibatches anywhere and pads every episode to the longest. Here a minibatch holds
    all steps of some environments, so that LSTM sequences stay whole, every process makes the same
    number of optimiser steps, and a rollout that was broken off early needs no filling.

    Args:
        args: The library's.
        num_minibatches: Groups that the environments are dealt into.
        normalises_advantages: Whether advantages get mean 0 and variance 1, over all processes.
        ranks: The processes that learn together.
        rng: Deals the environments.
        kwargs: The library's.
    """

    def __init__(
        self,
        *args: Any,
        num_minibatches: int,
        normalises_advantages: bool,
        ranks: Ranks,
        rng: np.random.Generator,
        **kwargs: Any,
    ) -> None:
        self._num_minibatches, self._normalises = num_minibatches, normalises_advantages
        self._ranks, self._rng = ranks, rng
        super().__init__(*args, **kwargs)
        if self.n_envs % num_minibatches:
            raise ValueError(
                f"`num_minibatches` must divide the {self.n_envs} environments, got {num_minibatches}"
            )
        self.capacity: int = self.buffer_size

    def reset(self) -> None:
        """Empty the buffer, and give a rollout that was broken off its room back."""
        self.buffer_size = getattr(self, "capacity", self.buffer_size)
        super().reset()

    def compute_returns_and_advantage(self, last_values: Tensor, dones: np.ndarray) -> None:
        """See the library; what a rollout that was broken off left empty is cut away first."""
        if not self.full:
            self._cut()
        super().compute_returns_and_advantage(last_values, dones)
        if self._normalises:
            self._normalise()

    def get(self, batch_size: int | None = None) -> Iterator[RecurrentDictRolloutBufferSamples]:  # noqa: ARG002
        """Hand out the groups of environments in random order.

        Args:
            batch_size: Ignored.
        """
        order = self._rng.permutation(self.n_envs)
        for group in np.split(order, self._num_minibatches):
            yield self._samples_of(group)

    def _samples_of(self, group: np.ndarray) -> RecurrentDictRolloutBufferSamples:
        """All steps of some environments, those of an environment side by side."""

        def take(values: np.ndarray) -> Tensor:
            chosen = values[:, group].swapaxes(0, 1)
            return self.to_torch(np.ascontiguousarray(chosen.reshape(-1, *chosen.shape[2:])))

        hidden, cell = (self.to_torch(getattr(self, name)[0][:, group]) for name in STATE_ARRAYS)
        returns = take(self.returns).flatten()
        return RecurrentDictRolloutBufferSamples(
            observations={key: take(values) for key, values in self.observations.items()},
            actions=take(self.actions),
            old_values=take(self.values).flatten(),
            old_log_prob=take(self.log_probs).flatten(),
            advantages=take(self.advantages).flatten(),
            returns=returns,
            lstm_states=RNNStates((hidden, cell), (hidden, cell)),
            episode_starts=take(self.episode_starts).flatten(),
            mask=returns.new_ones(returns.shape),
        )

    def _cut(self) -> None:
        for name in (*STEP_ARRAYS, *STATE_ARRAYS):
            setattr(self, name, getattr(self, name)[: self.pos])
        self.observations = {key: values[: self.pos] for key, values in self.observations.items()}
        self.buffer_size, self.full = self.pos, True

    def _normalise(self) -> None:
        """With sums over all processes, which may hold different numbers of steps."""
        values = self.advantages.astype(np.float64)
        total, squares, count = self._ranks.total(values.sum(), (values**2).sum(), values.size)
        mean = total / count
        std = np.sqrt(max(squares / count - mean**2, 0.0))
        self.advantages = ((values - mean) / (std + 1e-8)).astype(np.float32)
