"""Learning of OccAnt's global policy by PPO in the 2-D twin, and the coverage that it reaches.

Every update plays whole episodes that its number seeds, so a killed run goes on bit for bit.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import DummyVecEnv

from agents.goal_net import GoalNet
from agents.occant_model import OccAntSettings, new_goal_net
from anm_gym.checks import check_at_least, check_positive, check_share
from train.occant.goal_policy import GoalPolicy
from train.occant.twin import REWARD_PER_M2, Anticipator, OccAntTwinEnv, TwinSettings
from train.occant.twin_world import TwinWorld
from train.progress_file import load_progress, save_progress

FIRST_LOGIT_SHARE: Final = 0.1
"""Factor on the first weights of the actor's last layer: goals are nearly equally likely at first."""
Chooser = Callable[[NDArray[np.float32], np.random.Generator], int]
"""Chooses a goal for a view."""


@dataclass(frozen=True)
class GoalLearning:
    """How the global policy learns; numbers of the paper's code in brackets where they differ."""

    updates: int = 80
    """Rollouts, each followed by the gradient steps on it (1000)."""
    value_updates: int = 8
    """Updates at the start in which only the critic learns, so that its first errors do not spoil the
    policy that is started from (ours)."""
    envs: int = 32
    """Episodes of a rollout (36)."""
    epochs: int = 4
    """Passes over a rollout."""
    minibatches: int = 4
    """Batches of a pass."""
    learning_rate: float = 5e-4
    """Of Adam (2.5e-4); it falls linearly to a tenth."""
    gamma: float = 0.9
    """Discount from goal to goal (0.99)."""
    gae_lambda: float = 0.9
    """Of the advantages (0.95)."""
    entropy: float = 1e-3
    """Weight of the entropy."""
    clip: float = 0.2
    """Range of the ratios."""
    max_gradient: float = 0.5
    """Norm at which gradients are cut."""

    def __post_init__(self) -> None:
        check_at_least(self, 1, "updates", "envs", "epochs", "minibatches")
        check_at_least(self, 0, "value_updates", "entropy")
        check_positive(self, "learning_rate", "clip", "max_gradient")
        check_share(self, "gamma", "gae_lambda")


@final
class GoalLearner:
    """The global policy while it learns.

    Args:
        model: What the policy is.
        twin: The episodes.
        settings: How it learns.
        worlds: Homes to learn in.
        anticipator: Completes looks; frozen.
        seed: Seeds weights, episodes and draws.
        start: The policy to start from; None for an untrained one.

    Source:
        Occupancy Anticipation: PPO on goals that each have a fixed number of steps. The anticipator is
        trained first and does not change, where the paper trains both together.
    """

    def __init__(
        self,
        model: OccAntSettings,
        twin: TwinSettings,
        settings: GoalLearning,
        worlds: Sequence[TwinWorld],
        anticipator: Anticipator | None,
        seed: int,
        start: GoalNet | None = None,
    ) -> None:
        self.settings, self._twin, self._seed = settings, twin, seed
        self._envs = DummyVecEnv(
            [lambda: Monitor(OccAntTwinEnv(worlds, twin, anticipator)) for _ in range(settings.envs)]
        )
        self._ppo = PPO(
            GoalPolicy,
            self._envs,
            learning_rate=lambda _: self._learning_rate,
            n_steps=twin.goals,
            batch_size=max(2, settings.envs * twin.goals // settings.minibatches),
            n_epochs=settings.epochs,
            gamma=settings.gamma,
            gae_lambda=settings.gae_lambda,
            clip_range=settings.clip,
            ent_coef=settings.entropy,
            max_grad_norm=settings.max_gradient,
            policy_kwargs={"goal_net": model.goal_net},
            seed=seed,
            device="cpu",
        )
        self._begin_with(start or _nearly_uniform(new_goal_net(model, seed)))
        self.num_done = 0
        self.curve: list[dict[str, float]] = []
        """Of each update: `gain_m2` an episode is paid for, `entropy`, `explained` variance of returns."""

    @property
    def goal_net(self) -> GoalNet:
        """The actor as it is now."""
        net = self._ppo.policy.action_net
        assert isinstance(net, GoalNet)
        return net

    def learn(self) -> Iterator[dict[str, float]]:
        """Do the updates that remain; yields the curve's point of each."""
        policy, steps = self._ppo.policy, self.settings.envs * self._twin.goals
        while self.num_done < self.settings.updates:
            # What is drawn in an update depends on its number alone.
            seed = int(np.random.default_rng([self._seed, self.num_done]).integers(2**31))
            set_random_seed(seed)
            self._envs.seed(seed)
            self.goal_net.requires_grad_(self.num_done >= self.settings.value_updates)
            self._ppo.learn(steps)
            assert self._ppo.ep_info_buffer is not None
            gains = [episode["r"] / REWARD_PER_M2 for episode in self._ppo.ep_info_buffer]
            logged = self._ppo.logger.name_to_value
            point = {
                "gain_m2": float(np.mean(gains)),
                "entropy": -float(logged["train/entropy_loss"]),
                "explained": float(logged["train/explained_variance"]),
            }
            policy.set_training_mode(False)
            self.num_done += 1
            self.curve.append(point)
            yield point

    def save(self, path: Path) -> None:
        """Keep networks, optimiser and curve."""
        progress = {"num_done": self.num_done, "curve": self.curve}
        save_progress(path, {"policy": self._ppo.policy}, self._ppo.policy.optimizer, progress)

    def load(self, path: Path) -> None:
        """Go back to what `save` kept."""
        progress = load_progress(path, {"policy": self._ppo.policy}, self._ppo.policy.optimizer)
        self.num_done, self.curve = progress["num_done"], progress["curve"]

    @property
    def _learning_rate(self) -> float:
        done = getattr(self, "num_done", 0) / self.settings.updates
        return self.settings.learning_rate * (1.0 - 0.9 * done)

    def _begin_with(self, net: GoalNet) -> None:
        self.goal_net.load_state_dict(net.state_dict())


def _nearly_uniform(net: GoalNet) -> GoalNet:
    """Scale the last layer, so that goals are nearly equally likely."""
    last = net.layers[-1]
    assert isinstance(last, torch.nn.Conv2d)
    with torch.no_grad():
        last.weight.mul_(FIRST_LOGIT_SHARE)
    return net


def coverage(
    choose: Chooser,
    worlds: Sequence[TwinWorld],
    twin: TwinSettings,
    anticipator: Anticipator | None,
    episodes: int,
    seed: int,
) -> list[float]:
    """Play episodes in turn through some homes.

    Args:
        choose: Chooses the goals.
        worlds: The homes.
        twin: The episodes.
        anticipator: Completes looks.
        episodes: How many.
        seed: Seeds starts and draws.

    Returns:
        Mean share of the layout that was seen, at the start and after each goal.
    """
    env = OccAntTwinEnv(worlds, twin, anticipator)
    shares = np.zeros((episodes, twin.goals + 1))
    for episode in range(episodes):
        rng = np.random.default_rng([seed, episode])
        view, info = env.reset(seed=int(rng.integers(2**31)), options={"world": episode % len(worlds)})
        shares[episode, 0] = info["seen_share"]
        for goal in range(twin.goals):
            view, _, _, _, info = env.step(np.int64(choose(view, rng)))
            shares[episode, goal + 1] = info["seen_share"]
    means: list[float] = shares.mean(axis=0).tolist()
    return means


def random_chooser(num_goals: int) -> Chooser:
    """Choose any goal."""
    return lambda _, rng: int(rng.integers(num_goals))


def policy_chooser(net: GoalNet, *, samples: bool) -> Chooser:
    """Choose the likeliest goal, or draw one."""

    def choose(view: NDArray[np.float32], rng: np.random.Generator) -> int:
        with torch.inference_mode():
            logits = net(torch.from_numpy(view)[None])[0].numpy()
        noise: Any = rng.gumbel(size=logits.shape) if samples else 0.0
        return int(np.argmax(logits + noise))

    return choose
