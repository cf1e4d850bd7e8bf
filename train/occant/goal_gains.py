"""What a goal is worth, learned from random ones: a start for the global policy that PPO goes on from.

The first thing PPO would have to find out, from few goals, is which of them show anything new. That is
a regression, and it learns more from every goal: the same view turned and mirrored is as good a sample.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors.numpy import load_file, save_file
from torch import Tensor, nn
from tqdm import tqdm

from agents.goal_net import GoalNet
from agents.layout_memory import VIEW_CHANNELS
from agents.occant_model import OccAntSettings, new_goal_net
from train.occant.goal_policy import GoalValueNet
from train.occant.twin import REWARD_PER_M2, Anticipator, OccAntTwinEnv, TwinSettings
from train.occant.twin_world import TwinWorld
from train.progress_file import load_progress, save_progress

CURVE_BATCHES: Final = 50
"""Batches whose mean loss is a point of the curve."""
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
        if self.episodes < 0 or min(self.passes, self.batch) < 1:
            raise ValueError(
                "`episodes` must be >= 0, `passes` and `batch` >= 1, "
                f"got {self.episodes}, {self.passes} and {self.batch}"
            )

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


def gather_gains(
    worlds: Sequence[TwinWorld],
    twin: TwinSettings,
    anticipator: Anticipator | None,
    episodes: int,
    seed: int,
    path: Path | None = None,
) -> GoalGains:
    """Play episodes of random goals, or read them from the file where they were kept."""
    if path and path.exists():
        return GoalGains(**load_file(path))
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
    gathered = GoalGains(np.stack(views), np.array(goals, np.int64), np.array(gains_m2, np.float32))
    if path:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(path.name + ".partial")
        save_file(vars(gathered), partial)
        partial.replace(path)
    return gathered


@final
class GainLearner:
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
        self._nets: dict[str, nn.Module] = {"scores": self.scores, "value": self.value}
        parameters = [*self.scores.parameters(), *self.value.parameters()]
        self.optimizer = torch.optim.Adam(parameters, settings.learning_rate)
        self.num_done, self.curve = 0, list[float]()
        """`curve`: mean squared error of the gains, m^4, every 50 batches."""
        self._losses: list[float] = []

    def learn(self, gains: GoalGains) -> Iterator[float]:
        """Take the gradient steps that remain; yields the loss of each."""
        while self.num_done < self.settings.num_batches:
            views, goals, gains_m2 = self._draw(gains)
            for group in self.optimizer.param_groups:
                group["lr"] = self.settings.learning_rate * (1.0 - self.num_done / self.settings.num_batches)
            expected_m2 = self.value(views)[:, 0] + self.scores(views).gather(1, goals[:, None])[:, 0]
            loss = (expected_m2 - gains_m2).square().mean()
            self.optimizer.zero_grad()
            loss.backward()
            self.optimizer.step()
            self.num_done += 1
            self._note(loss.item())
            yield loss.item()

    @torch.no_grad()
    def goal_net(self) -> GoalNet:
        """The policy that prefers goals by what they are worth."""
        net = GoalNet(self.scores.settings)
        net.load_state_dict(self.scores.state_dict())
        last = net.layers[-1]
        for values in last.parameters():
            values.mul_(self.settings.logit_per_m2)
        return net

    def save(self, path: Path) -> None:
        """Keep networks, optimiser and curve."""
        progress = {"num_done": self.num_done, "curve": self.curve, "losses": self._losses}
        save_progress(path, self._nets, self.optimizer, progress)

    def load(self, path: Path) -> None:
        """Go back to what `save` kept."""
        progress = load_progress(path, self._nets, self.optimizer)
        self.num_done, self.curve, self._losses = (progress[k] for k in ("num_done", "curve", "losses"))

    def _draw(self, gains: GoalGains) -> tuple[Tensor, Tensor, Tensor]:
        rng = np.random.default_rng([self._seed, 3, self.num_done])
        chosen = rng.integers(len(gains.goals), size=self.settings.batch)
        views = gains.views[chosen].astype(np.float32) / np.float32(255.0)
        views, goals = turn_views(views, gains.goals[chosen], int(rng.integers(4)), bool(rng.integers(2)))
        return torch.from_numpy(views), torch.from_numpy(goals), torch.from_numpy(gains.gains_m2[chosen])

    def _note(self, loss: float) -> None:
        self._losses.append(loss)
        if len(self._losses) == CURVE_BATCHES or self.num_done == self.settings.num_batches:
            self.curve.append(float(np.mean(self._losses)))
            self._losses = []


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
