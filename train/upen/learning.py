"""Learning of one member of UPEN's ensemble, in checkpoints that a killed run goes on from."""

from dataclasses import dataclass
from typing import Final, Literal, final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.occupancy_net import channels_last
from agents.upen_ensemble import EnsembleSettings, new_net
from anm_gym.checks import check_at_least, check_choices, check_positive, check_share
from train.batch_learning import BatchLearner
from train.upen.data import LEVELS, Crops

BETAS: Final = (0.5, 0.999)
"""Of Adam (UPEN's code)."""


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
        check_choices(self)
        check_at_least(self, 1, "passes", "batch")
        check_positive(self, "learning_rate")
        check_share(self, "last_rate_share")
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
class MemberLearner(BatchLearner[Crops]):
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
        optimizer = torch.optim.Adam(self.net.parameters(), lr=settings.learning_rate, betas=BETAS)
        super().__init__({"net": self.net}, optimizer, settings.num_batches)

    def _loss(self, data: Crops) -> Tensor:
        inputs, labels = self._draw(data)
        loss: Tensor = nn.functional.cross_entropy(self.net(inputs), labels)
        return loss

    def _learning_rate(self, done_share: float) -> float:
        return float(self.settings.learning_rate * self.settings.last_rate_share**done_share)

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


def as_tensor(inputs: NDArray[np.uint8]) -> Tensor:
    """Turn kept inputs into probabilities, (B, 3, h, w) float32, as networks read them fastest."""
    tensor = torch.from_numpy(inputs).float().mul_(1.0 / LEVELS)
    return tensor.contiguous(memory_format=torch.channels_last)
