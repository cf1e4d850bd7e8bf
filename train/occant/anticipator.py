"""Learning of OccAnt's anticipator, in checkpoints that a killed run goes on from, and its scores."""

from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from agents.layout_memory import EXPLORED, OCCUPIED
from agents.occant_model import Anticipator, OccAntSettings, new_anticipator_net
from agents.occupancy_net import channels_last
from anm_gym.checks import check_at_least, check_positive, check_share
from train.batch_learning import BatchLearner
from train.occant.frames import Frames, as_arrays

BATCH: Final = 50
"""Frames that are scored at once."""
CLASS_NAMES: Final = ("free", "occupied")
PARTS: Final = ("revealed", "unseen")
"""Cells that are scored: all that could be told, and those of them that the image did not show."""


@dataclass(frozen=True)
class AnticipatorLearning:
    """How the anticipator learns."""

    passes: int = 80_000
    """Frames that it looks at, repeated ones too."""
    batch: int = 32
    """Frames of a batch; 420 in the paper's code."""
    learning_rate: float = 2e-3
    """Of Adam at the start; 1e-3 in the paper's code, which learns much longer."""
    last_rate_share: float = 0.03
    """Share of the learning rate that is left at the end; it falls exponentially."""
    max_gradient: float = 0.5
    """Norm at which gradients are cut (paper's code)."""
    mirrors: bool = True
    """Whether every second frame is mirrored, left to right."""

    def __post_init__(self) -> None:
        check_at_least(self, 1, "passes", "batch")
        check_positive(self, "learning_rate", "max_gradient")
        check_share(self, "last_rate_share")

    @property
    def num_batches(self) -> int:
        """Gradient steps."""
        return -(-self.passes // self.batch)


@final
class AnticipatorLearner(BatchLearner[Frames]):
    """The anticipator while it learns; a batch is drawn from its number, so checkpoints need no generator.

    Args:
        model: What the network is.
        settings: How it learns.
        seed: Seeds weights and batches.

    Source:
        Occupancy Anticipation: binary cross-entropy of both channels over all cells.
    """

    def __init__(self, model: OccAntSettings, settings: AnticipatorLearning, seed: int) -> None:
        self.settings, self._seed = settings, seed
        self.net = channels_last(new_anticipator_net(model, seed))
        optimizer = torch.optim.Adam(self.net.parameters(), settings.learning_rate)
        super().__init__({"net": self.net}, optimizer, settings.num_batches, settings.max_gradient)

    def anticipator(self) -> Anticipator:
        """The anticipator as it is now."""
        return Anticipator(self.net)

    def _loss(self, data: Frames) -> Tensor:
        looks, labels = self._draw(data)
        return functional.binary_cross_entropy_with_logits(self.net(_as_tensor(looks)), _as_tensor(labels))

    def _learning_rate(self, done_share: float) -> float:
        return float(self.settings.learning_rate * self.settings.last_rate_share**done_share)

    def _draw(self, frames: Frames) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        rng = np.random.default_rng([self._seed, 1, self.num_done])
        looks, labels = as_arrays(frames, rng.integers(len(frames), size=self.settings.batch))
        if self.settings.mirrors:
            is_mirrored = rng.random(self.settings.batch) < 0.5
            looks[is_mirrored] = looks[is_mirrored, :, :, ::-1]
            labels[is_mirrored] = labels[is_mirrored, :, :, ::-1]
        return looks, labels


def score_anticipator(anticipator: Anticipator, frames: Frames) -> dict[str, Any]:
    """Score looks as they are, and completed, on homes that were not learned from.

    Args:
        anticipator: What completes them.
        frames: Looks and what is there.

    Returns:
        F1 and IoU of free and occupied by predictor and part, `frames`, and `explored_iou` of what a
        predictor claims to know.
    """
    counts = {name: _Counts() for name in ("seen only", "anticipated")}
    for begin in range(0, len(frames), BATCH):
        looks, labels = as_arrays(frames, np.arange(begin, min(begin + BATCH, len(frames))))
        counts["seen only"].add(looks, looks, labels)
        counts["anticipated"].add(anticipator(looks), looks, labels)
    return {"frames": len(frames), **{name: count.as_dict() for name, count in counts.items()}}


def format_anticipation(scores: dict[str, Any]) -> str:
    """Lay the scores out as a table."""
    titles = [f"{part} {name}" for part in PARTS for name in CLASS_NAMES]
    lines = [f"{'on unseen homes, F1 / IoU':26}" + "".join(f"{title:>20}" for title in titles)]
    for name in ("seen only", "anticipated"):
        cells = [scores[name][part][kind] for part in PARTS for kind in CLASS_NAMES]
        lines.append(f"{name:26}" + "".join(f"{c['f1']:12.3f} / {c['iou']:.3f}" for c in cells))
    return "\n".join(lines)


class _Counts:
    """Hits, false alarms and misses by part and class."""

    def __init__(self) -> None:
        self._counts = {part: {name: np.zeros(3, np.int64) for name in CLASS_NAMES} for part in PARTS}
        self._explored = np.zeros(3, np.int64)

    def add(
        self, predicted: NDArray[np.float32], looks: NDArray[np.float32], labels: NDArray[np.float32]
    ) -> None:
        truth, guess = _classes(labels), _classes(predicted)
        is_unseen = looks[:, EXPLORED] < 0.5
        for name in CLASS_NAMES:
            self._counts["revealed"][name] += _compare(guess[name], truth[name])
            self._counts["unseen"][name] += _compare(guess[name][is_unseen], truth[name][is_unseen])
        self._explored += _compare(predicted[:, EXPLORED] > 0.5, labels[:, EXPLORED] > 0.5)

    def as_dict(self) -> dict[str, Any]:
        parts = {
            part: {name: _measures(count) for name, count in counts.items()}
            for part, counts in self._counts.items()
        }
        return {**parts, "explored_iou": _measures(self._explored)["iou"]}


def _classes(layout: NDArray[np.float32]) -> dict[str, NDArray[np.bool_]]:
    is_known, is_occupied = layout[:, EXPLORED] > 0.5, layout[:, OCCUPIED] > 0.5
    return {"free": is_known & ~is_occupied, "occupied": is_known & is_occupied}


def _compare(guess: NDArray[np.bool_], truth: NDArray[np.bool_]) -> NDArray[np.int64]:
    return np.array([(guess & truth).sum(), (guess & ~truth).sum(), (~guess & truth).sum()], np.int64)


def _measures(counts: NDArray[np.int64]) -> dict[str, float]:
    hits, false, missed = (int(count) for count in counts)
    return {
        "f1": 2 * hits / max(2 * hits + false + missed, 1),
        "iou": hits / max(hits + false + missed, 1),
    }


def _as_tensor(values: NDArray[np.float32]) -> torch.Tensor:
    return torch.from_numpy(np.ascontiguousarray(values)).contiguous(memory_format=torch.channels_last)
