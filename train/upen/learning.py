"""Learning of one member of UPEN's ensemble, in checkpoints that a killed run goes on from."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, final, get_args

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.occupancy_net import channels_last
from agents.upen_ensemble import EnsembleSettings, new_net
from train.progress_file import load_progress, save_progress
from train.upen.data import LEVELS, Crops

BETAS: Final = (0.5, 0.999)
"""Of Adam (UPEN's code)."""
CURVE_BATCHES: Final = 50
"""Batches whose mean loss is a point of the curve."""


Split = Literal["overlap", "disjoint"]


@dataclass(frozen=True)
class LearningSettings:
    """How a member learns."""

    passes: int = 20_000
    """Crops that a member looks at, repeated ones too."""
    batch: int = 16
    """Crops of a batch; 40 in UPEN's code."""
    learning_rate: float = 1e-3
    """Of Adam at the start; 2e-4 in UPEN's code, which learns much longer."""
    last_rate_share: float = 0.02
    """Share of the learning rate that is left at the end; it falls exponentially."""
    mirrors: bool = True
    """Whether every second crop is mirrored, left to right."""
    split: Split = "overlap"
    """`overlap`: each member learns from its own random share of the homes (paper); `disjoint`: the homes
    are dealt out, no two members see the same."""
    share: float = 0.7
    """Share of the homes that a member learns from (`overlap`; paper)."""

    def __post_init__(self) -> None:
        if self.passes < 1 or self.batch < 1:
            raise ValueError(f"`passes` and `batch` must be >= 1, got {self.passes} and {self.batch}")
        if self.split not in get_args(Split):
            raise ValueError(f"`split` must be one of {', '.join(get_args(Split))}, got {self.split!r}")
        if not 0.0 < self.share <= 1.0:
            raise ValueError(f"`share` must be in (0, 1], got {self.share}")

    @property
    def num_batches(self) -> int:
        """Gradient steps of a member."""
        return -(-self.passes // self.batch)


def homes_of_member(
    num_homes: int, member: int, num_members: int, settings: LearningSettings, seed: int
) -> NDArray[np.int64]:
    """Choose the homes that a member learns from, as indices in order."""
    if settings.split == "disjoint":
        return np.sort(np.random.default_rng([seed, 1]).permutation(num_homes)[member::num_members])
    rng = np.random.default_rng([seed, 2, member])
    return np.sort(rng.choice(num_homes, max(1, round(settings.share * num_homes)), replace=False))


@final
class Learner:
    """One member while it learns; every batch is drawn from its number, so a checkpoint needs no generator.

    Args:
        raster: What the member is.
        settings: How it learns.
        seed: Seeds weights and batches.
        member: Its index.
    """

    def __init__(self, raster: EnsembleSettings, settings: LearningSettings, seed: int, member: int) -> None:
        self.settings, self._key = settings, [seed, 3, member]
        self.net = channels_last(new_net(raster, 1000 * seed + member))
        self.optimizer = torch.optim.Adam(self.net.parameters(), lr=settings.learning_rate, betas=BETAS)
        self.num_done = 0
        self.curve: list[float] = []
        self._losses: list[float] = []

    def learn(self, crops: Crops) -> Iterator[float]:
        """Go on to the end; yields the loss after every batch."""
        self.net.train()
        while self.num_done < self.settings.num_batches:
            inputs, labels = self._draw(crops)
            self._set_learning_rate()
            loss = nn.functional.cross_entropy(self.net(inputs), labels)
            self.optimizer.zero_grad()
            loss.backward()
            self.optimizer.step()
            self.num_done += 1
            self._note(float(loss.detach()))
            yield self._losses[-1] if self._losses else self.curve[-1]

    def save(self, path: Path) -> None:
        """Keep weights, optimiser and curve; the file appears whole or not at all."""
        progress = {"num_done": self.num_done, "curve": self.curve, "losses": self._losses}
        save_progress(path, {"net": self.net}, self.optimizer, progress)

    def load(self, path: Path) -> None:
        """Go back to what `save` kept."""
        progress = load_progress(path, {"net": self.net}, self.optimizer)
        self.num_done, self.curve, self._losses = (progress[k] for k in ("num_done", "curve", "losses"))

    def _draw(self, crops: Crops) -> tuple[Tensor, Tensor]:
        """A batch: (B, 3, h, w) float32 probabilities and (B, h, w) int64 classes."""
        rng = np.random.default_rng([*self._key, self.num_done])
        chosen = rng.integers(len(crops), size=self.settings.batch)
        inputs, labels = crops.inputs[chosen], crops.labels[chosen]
        if self.settings.mirrors:
            is_mirrored = rng.random(self.settings.batch) < 0.5
            inputs[is_mirrored] = inputs[is_mirrored, :, :, ::-1]
            labels[is_mirrored] = labels[is_mirrored, :, ::-1]
        return as_tensor(inputs), torch.from_numpy(labels.astype(np.int64))

    def _set_learning_rate(self) -> None:
        done = self.num_done / self.settings.num_batches
        for group in self.optimizer.param_groups:
            group["lr"] = self.settings.learning_rate * self.settings.last_rate_share**done

    def _note(self, loss: float) -> None:
        self._losses.append(loss)
        if len(self._losses) == CURVE_BATCHES or self.num_done == self.settings.num_batches:
            self.curve.append(float(np.mean(self._losses)))
            self._losses = []


def as_tensor(inputs: NDArray[np.uint8]) -> Tensor:
    """Turn kept inputs into probabilities, (B, 3, h, w) float32, as networks read them fastest."""
    tensor = torch.from_numpy(inputs).float().mul_(1.0 / LEVELS)
    return tensor.contiguous(memory_format=torch.channels_last)
