"""Recurrent PPO as DD-PPO runs it, on one process or on those of `torchrun`.

The library's `train` is used as it is: its minibatches come from `EnvironmentBuffer`, its policy is
`NavigatorPolicy`, and gradients are averaged and clipped right before the optimiser steps.
"""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
import torch
from sb3_contrib import RecurrentPPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import obs_as_tensor
from stable_baselines3.common.vec_env import VecEnv

from agents.navigator_net import NavigatorNetSettings
from anm_gym.checks import check_at_least, check_positive, check_share
from train.navigator.buffer import EnvironmentBuffer
from train.navigator.policy import NavigatorPolicy
from train.navigator.preemption import Preemption
from train.navigator.ranks import Ranks

NO_CLIPPING: Final = float("inf")


@dataclass(frozen=True)
class PpoSettings:
    """Constants of PPO.

    Source:
        Wijmans et al., DD-PPO, ICLR 2020, and its published configuration; what differs says so.
    """

    frames: int = 900_000
    """Frames of this stage, over all processes."""
    rollout_steps: int = 128
    """Steps of every agent in a rollout."""
    epochs: int = 2
    """Passes over a rollout."""
    minibatches: int = 4
    """Groups of environments per pass (DD-PPO: 2; four learn faster on a small budget)."""
    learning_rate: float = 2.5e-4
    """Of Adam."""
    decays_learning_rate: bool = True
    """Whether it falls linearly, to 0 after the last update (DD-PPO: not)."""
    clip_range: float = 0.2
    """Of the ratio of probabilities, and of values."""
    entropy_weight: float = 0.01
    """Weight of the entropy."""
    value_weight: float = 0.25
    """Weight of the squared error of the value (DD-PPO: 0.5 on half of it)."""
    max_grad_norm: float = 0.2
    """Gradients are clipped to this norm after they were averaged."""
    discount: float = 0.99
    """Of rewards, per step."""
    gae_lambda: float = 0.95
    """Of the generalised advantage estimate."""
    normalises_advantages: bool = True
    """Whether advantages are normalised (DD-PPO: not)."""
    value_frames: int = 40_000
    """Frames at the start in which only the critic learns (ours: imitation has not taught it)."""

    def __post_init__(self) -> None:
        check_at_least(self, 0, "frames", "value_frames", "entropy_weight", "value_weight")
        check_at_least(self, 1, "rollout_steps", "epochs", "minibatches")
        check_positive(self, "learning_rate", "clip_range", "max_grad_norm")
        check_share(self, "discount", "gae_lambda")


def _decaying(rate: float) -> Callable[[float], float]:
    return lambda remaining: remaining * rate


@final
class NavigatorPpo(RecurrentPPO):
    """Recurrent PPO for navigators.

    Args:
        env: A `NavigationVecEnv`, monitored.
        net: Sizes of the network.
        settings: Constants.
        ranks: The processes that learn together.
        seed: Seeds draws and, one after the other, the agents of all processes.
        kwargs: The library's: `tensorboard_log`, `verbose`, `device`.
    """

    policy: NavigatorPolicy
    rollout_buffer: EnvironmentBuffer

    def __init__(
        self,
        env: VecEnv,
        net: NavigatorNetSettings,
        settings: PpoSettings,
        ranks: Ranks | None = None,
        seed: int = 0,
        **kwargs: Any,
    ) -> None:
        self.settings, self.ranks = settings, ranks or Ranks()
        self._preemption = Preemption(self.ranks)
        self._rollout_start = 0
        super().__init__(
            NavigatorPolicy,
            env,
            learning_rate=_decaying(settings.learning_rate)
            if settings.decays_learning_rate
            else settings.learning_rate,
            n_steps=settings.rollout_steps,
            batch_size=None,
            n_epochs=settings.epochs,
            gamma=settings.discount,
            gae_lambda=settings.gae_lambda,
            clip_range=settings.clip_range,
            clip_range_vf=settings.clip_range,
            normalize_advantage=False,
            ent_coef=settings.entropy_weight,
            vf_coef=settings.value_weight,
            max_grad_norm=NO_CLIPPING,
            policy_kwargs={"net": net},
            seed=seed + self.ranks.rank * env.num_envs,
            **kwargs,
        )

    def _setup_model(self) -> None:
        super()._setup_model()
        buffer = self.rollout_buffer
        self.rollout_buffer = EnvironmentBuffer(
            self.n_steps,
            self.observation_space,
            self.action_space,
            buffer.hidden_state_shape,
            self.device,
            gamma=self.gamma,
            gae_lambda=self.gae_lambda,
            n_envs=self.n_envs,
            num_minibatches=self.settings.minibatches,
            normalises_advantages=self.settings.normalises_advantages,
            ranks=self.ranks,
            rng=np.random.default_rng(self.seed),
        )
        self.share_optimiser()

    def share_optimiser(self) -> None:
        """Begin with the first process's weights; average and clip gradients before every step."""
        self.ranks.synchronise(self.policy)
        self.policy.optimizer.register_step_pre_hook(self._average_and_clip)

    def _average_and_clip(self, *_: Any) -> None:
        self.ranks.average_gradients(self.policy.parameters())
        torch.nn.utils.clip_grad_norm_(self.policy.parameters(), self.settings.max_grad_norm)

    def collect_rollouts(
        self, env: VecEnv, callback: BaseCallback, rollout_buffer: RolloutBuffer, n_rollout_steps: int
    ) -> bool:
        """Collect a rollout, or as much of one as the other processes wait for.

        A time limit ends an episode for good, and frames are counted over all processes, so that all
        stop after the same update.
        """
        self.policy.set_training_mode(False)
        rollout_buffer.reset()
        callback.on_rollout_start()
        self._preemption.begin()
        self._rollout_start = self.num_timesteps
        states = deepcopy(self._last_lstm_states)
        goes_on, steps = True, 0
        while steps < n_rollout_steps and not self._preemption.is_late(steps / n_rollout_steps):
            before = states
            actions, values, log_probs, states = self._choose(states)
            observation, rewards, dones, infos = env.step(actions)
            callback.update_locals(locals())
            goes_on = callback.on_step() and goes_on
            self._update_info_buffer(infos, dones)
            rollout_buffer.add(
                self._last_obs,
                actions.reshape(-1, 1),
                rewards,
                self._last_episode_starts,
                values,
                log_probs,
                lstm_states=before,
            )
            self._last_obs, self._last_episode_starts, self._last_lstm_states = observation, dones, states
            steps += 1
        self._preemption.finish()
        rollout_buffer.compute_returns_and_advantage(self._last_values(states), self._last_episode_starts)
        frames, stops = self.ranks.total(steps * env.num_envs, float(not goes_on))
        self.num_timesteps += round(frames)
        callback.on_rollout_end()
        return stops == 0.0

    def _update_current_progress_remaining(self, num_timesteps: int, total_timesteps: int) -> None:
        """Count the frames before a rollout, not those in it, so that the last update still learns."""
        before = min(num_timesteps, self._rollout_start)
        super()._update_current_progress_remaining(before, total_timesteps)

    @torch.no_grad()
    def _choose(self, states: Any) -> Any:
        observation = obs_as_tensor(self._last_obs, self.device)
        starts = torch.as_tensor(self._last_episode_starts, dtype=torch.float32, device=self.device)
        actions, values, log_probs, states = self.policy(observation, states, starts)
        return actions.cpu().numpy(), values, log_probs, states

    @torch.no_grad()
    def _last_values(self, states: Any) -> torch.Tensor:
        observation = obs_as_tensor(self._last_obs, self.device)
        starts = torch.as_tensor(self._last_episode_starts, dtype=torch.float32, device=self.device)
        return self.policy.predict_values(observation, states.pi, starts)
