"""What a goal is worth, learned from random ones: a start for the global policy that PPO goes on from.

The first thing PPO would have to find out, from few goals, is which of them show anything new. That is
a regression, and it learns more from every goal: the same view turned and mirrored is as good a sample.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from tqdm import tqdm

from agents.goal_net import GoalNet
from agents.layout_memory import VIEW_CHANNELS
from agents.occant_model import OccAntSettings, new_goal_net
from anm_gym.checks import check_at_least, check_positive
from train.batch_learning import BatchLearner
from train.kept_arrays import kept
from train.occant.goal_policy import GoalValueNet
from train.occant.twin import REWARD_PER_M2, Anticipator, OccAntTwinEnv, TwinSettings
from train.occant.twin_world import TwinWorld

SIDE_CHANNEL: Final = VIEW_CHANNELS - 1
"""The channel of a view that tells left from right: the sine of a goal's bearing."""


@dataclass(frozen=True)
class GainLearning:
    """How gains are gathered and learned (ours)."""

    episodes: int = 600
    """Episodes of random goals; 0 lets PPO start from an untrained policy."""
    passes: int = 96_000
    """Goals that are looked at, repeated ones too."""
    batch: int = 64
    """Goals of a batch."""
    learning_rate: float = 1e-3
    """Of Adam; it falls linearly to 0."""
    logit_per_m2: float = 3.0
    """How much likelier, in logits, a goal is made that is worth a square metre more."""

    def __post_init__(self) -> None:
        check_at_least(self, 0, "episodes", "logit_per_m2")
        check_at_least(self, 1, "passes", "batch")
        check_positive(self, "learning_rate")

    @property
    def num_batches(self) -> int:
        """Gradient steps."""
        return -(-self.passes // self.batch)


@dataclass(frozen=True, eq=False)
class GoalGains:
    """Random goals, and what they were paid."""

    views: NDArray[np.uint8]
    """(N, 9, G, G) what the policy is shown, times 255."""
    goals: NDArray[np.int64]
    """(N,) the goals."""
    gains_m2: NDArray[np.float32]
    """(N,) what they were paid, square metres."""


def gains_of(
    worlds: Sequence[TwinWorld],
    twin: TwinSettings,
    anticipator: Anticipator | None,
    episodes: int,
    seed: int,
    path: Path | None = None,
) -> GoalGains:
    """Play episodes of random goals, or read them from the file where they were kept."""
    return kept(path, GoalGains, lambda: _gather(worlds, twin, anticipator, episodes, seed))


def _gather(
    worlds: Sequence[TwinWorld], twin: TwinSettings, anticipator: Anticipator | None, episodes: int, seed: int
) -> GoalGains:
    env, rng = OccAntTwinEnv(worlds, twin, anticipator), np.random.default_rng([seed, 2])
    views, goals, gains_m2 = [], [], []
    for _ in tqdm(range(episodes), desc="random goals", unit="episode"):
        view, _ = env.reset(seed=int(rng.integers(2**31)))
        for _ in range(twin.goals):
            goal = rng.integers(twin.layout.num_goals)
            views.append(np.rint(255.0 * view).astype(np.uint8))
            view, reward, *_ = env.step(goal)
            goals.append(goal)
            gains_m2.append(reward / REWARD_PER_M2)
    return GoalGains(np.stack(views), np.array(goals, np.int64), np.array(gains_m2, np.float32))


@final
class GainLearner(BatchLearner[GoalGains]):
    """A policy that learns what goals are worth; a batch is drawn from its number.

    The gain of a goal is the value of the view plus the goal's own score, so that scores need not tell
    how much there is to see at all.

    Args:
        model: What the policy is.
        settings: How it learns.
        seed: Seeds weights and batches.
    """

    def __init__(self, model: OccAntSettings, settings: GainLearning, seed: int) -> None:
        self.settings, self._seed = settings, seed
        self.scores = new_goal_net(model, seed)
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            self.value = GoalValueNet(VIEW_CHANNELS, model.layout.view_cells)
        optimizer = torch.optim.Adam(
            [*self.scores.parameters(), *self.value.parameters()], settings.learning_rate
        )
        super().__init__({"scores": self.scores, "value": self.value}, optimizer, settings.num_batches)

    @torch.no_grad()
    def goal_net(self) -> GoalNet:
        """The policy that prefers goals by what they are worth."""
        net = GoalNet(self.scores.settings)
        net.load_state_dict(self.scores.state_dict())
        last = net.layers[-1]
        for values in last.parameters():
            values.mul_(self.settings.logit_per_m2)
        return net

    def _loss(self, data: GoalGains) -> Tensor:
        """Mean squared error of the gains, m^4."""
        views, goals, gains_m2 = self._draw(data)
        expected_m2 = self.value(views)[:, 0] + self.scores(views).gather(1, goals[:, None])[:, 0]
        loss: Tensor = (expected_m2 - gains_m2).square().mean()
        return loss

    def _learning_rate(self, done_share: float) -> float:
        return self.settings.learning_rate * (1.0 - done_share)

    def _draw(self, gains: GoalGains) -> tuple[Tensor, Tensor, Tensor]:
        rng = np.random.default_rng([self._seed, 3, self.num_done])
        chosen = rng.integers(len(gains.goals), size=self.settings.batch)
        views = gains.views[chosen].astype(np.float32) / np.float32(255.0)
        views, goals = turn_views(views, gains.goals[chosen], int(rng.integers(4)), bool(rng.integers(2)))
        return torch.from_numpy(views), torch.from_numpy(goals), torch.from_numpy(gains.gains_m2[chosen])


def turn_views(
    views: NDArray[np.float32], goals: NDArray[np.int64], quarters: int, mirrored: bool
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """What would be shown, and which goals they would be, had the world been mirrored and turned.

    Args:
        views: (N, 9, G, G) see `LayoutMemory.view`.
        goals: (N,) goals.
        quarters: Quarters of a turn, counter-clockwise as the view is laid out.
        mirrored: Whether columns are reversed first.
    """
    size = views.shape[-1]
    rows, columns = np.divmod(goals, size)
    if mirrored:
        views = views[..., ::-1].copy()
        views[:, SIDE_CHANNEL] = 1.0 - views[:, SIDE_CHANNEL]
        columns = size - 1 - columns
    for _ in range(quarters % 4):
        rows, columns = size - 1 - columns, rows
    return np.ascontiguousarray(np.rot90(views, quarters, axes=(2, 3))), rows * size + columns
