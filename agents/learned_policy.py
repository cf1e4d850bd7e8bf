"""A trained network at work: its recurrent state, and actions drawn from what it says."""

from collections.abc import Sequence
from typing import Any, final

import numpy as np
import torch
from numpy.typing import NDArray

from agents.draws import draws_of
from agents.navigator_net import NavigatorNet


@final
class LearnedPolicy:
    """Act for N agents with one network; each draws for itself, whoever acts beside it.

    Args:
        net: The network.
        num_agents: N.
        seed: Seeds the draws of all agents that are not given a seed of their own.
        deterministic: Take the likeliest action instead of drawing one.
    """

    def __init__(
        self, net: NavigatorNet, num_agents: int = 1, seed: int = 0, *, deterministic: bool = False
    ) -> None:
        self._net, self._deterministic = net, deterministic
        self._rngs = [draws_of(seed) for _ in range(num_agents)]
        self._state = net.first_state(num_agents)
        self._starts = np.ones(num_agents, np.float32)

    def begin(self, index: int, seed: int | None = None) -> None:
        """Forget an agent's past.

        Args:
            index: Which.
            seed: Seeds what it draws in a new episode; None for a new goal, its draws go on.
        """
        self._starts[index] = 1.0
        if seed is not None:
            self._rngs[index] = draws_of(seed)

    def keep(self, agents: Sequence[int]) -> None:
        """Go on with some of the agents only, in the order given."""
        hidden, cell = self._state
        self._state = hidden[:, agents], cell[:, agents]
        self._starts = self._starts[agents]
        self._rngs = [self._rngs[agent] for agent in agents]

    @torch.no_grad()
    def log_probabilities(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float64]:
        """(N, actions) log-probabilities for one frame of every agent; the state moves on."""
        tensors = {key: torch.from_numpy(values) for key, values in observation.items()}
        outputs, self._state = self._net.step(tensors, self._state, torch.from_numpy(self._starts))
        self._starts = np.zeros_like(self._starts)
        return np.asarray(torch.log_softmax(outputs.logits, dim=1).numpy(), np.float64)

    def act(
        self, observation: dict[str, NDArray[Any]], allowed: NDArray[np.bool_] | None = None
    ) -> NDArray[np.int64]:
        """Choose an action for every agent.

        Args:
            observation: One frame of every agent, see `NavigationObserver`.
            allowed: (N, actions) which actions are among the choices; None for all.

        Returns:
            (N,) actions.
        """
        scores = self.log_probabilities(observation)
        if allowed is not None:
            scores = np.where(allowed, scores, -np.inf)
        if not self._deterministic:
            scores = scores + np.stack([rng.gumbel(size=scores.shape[1]) for rng in self._rngs])
        return np.asarray(scores.argmax(axis=1), np.int64)
