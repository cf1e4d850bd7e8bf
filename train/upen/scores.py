"""How good UPEN's predictions are, and whether the ensemble's doubt points at its errors."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from agents.upen_ensemble import SCORES, Ensemble, doubt
from anm_gym.map.projection import NUM_CLASSES, VOID
from anm_gym.metrics.ranking import auroc
from train.upen.data import LEVELS, Crops
from train.upen.learning import as_tensor

CLASS_NAMES: Final = ("void", "occupied", "free")
SEEN_OVER: Final = 0.34
"""A cell was observed if its likeliest class has more than this (UPEN's code); uniform is a third."""
BATCH: Final = 25
RANKED_CELLS: Final = 300_000
"""Cells that are drawn for the rank statistics."""
PARTS: Final = ("all", "unobserved")
"""Which cells are scored."""


@dataclass(frozen=True, eq=False)
class Confusion:
    """Counts by true and by predicted class, of all cells and of those that were not observed."""

    counts: Mapping[str, NDArray[np.int64]]
    """(3, 3) by part."""

    @classmethod
    def empty(cls) -> "Confusion":
        """Begin to count."""
        return cls({part: np.zeros((NUM_CLASSES, NUM_CLASSES), np.int64) for part in PARTS})

    def add(
        self, truth: NDArray[np.integer], predicted: NDArray[np.integer], is_seen: NDArray[np.bool_]
    ) -> None:
        """Count cells."""
        pair = NUM_CLASSES * truth.astype(np.int64) + predicted
        for part, chosen in (("all", pair.ravel()), ("unobserved", pair[~is_seen])):
            counts = np.bincount(chosen, minlength=NUM_CLASSES**2)
            self.counts[part][:] += counts.reshape(NUM_CLASSES, NUM_CLASSES)

    def as_dict(self) -> dict[str, dict[str, float]]:
        """Intersection over union by class, their mean, and the share that is right, by part."""
        return {part: _measures(counts) for part, counts in self.counts.items()}


def evaluate(ensemble: Ensemble, crops: Crops, majority: int, seed: int) -> dict[str, Any]:
    """Score an ensemble on crops of unseen homes.

    Args:
        ensemble: The ensemble.
        crops: What it has not learned from.
        majority: The commonest class where it learned, the trivial guess for what was not observed.
        seed: Seeds the cells that are ranked.

    Returns:
        `iou` by predictor, part and class, and `auroc` by part and score: the chance that a cell where the
        likeliest class is wrong gets more doubt than one where it is right.
    """
    counts: dict[str, Confusion] = {}
    ranked = _Ranked(np.random.default_rng([seed, 4]), len(crops) * crops.labels[0].size)
    for begin in range(0, len(crops), BATCH):
        inputs, truth = crops.inputs[begin : begin + BATCH], crops.labels[begin : begin + BATCH]
        is_seen = inputs.max(axis=1) > SEEN_OVER * LEVELS
        members = ensemble.predict_batch(as_tensor(inputs)).numpy()
        predicted = _predictions(inputs, is_seen, members, majority)
        for name, classes in predicted.items():
            counts.setdefault(name, Confusion.empty()).add(truth, classes, is_seen)
        ranked.add(np.moveaxis(members, 1, 2), predicted["ensemble"] != truth, is_seen)
    iou = {name: confusion.as_dict() for name, confusion in counts.items()}
    return {"crops": len(crops), "iou": iou, "auroc": ranked.aurocs()}


def format_scores(scores: Mapping[str, Any]) -> str:
    """Lay the scores out as two tables."""
    lines = [f"{'IoU on unseen homes':22}" + "".join(f"{name:>26}" for name in PARTS)]
    lines.append(" " * 22 + "   void    occ   free   mean" * 1 + "   void    occ   free   mean")
    for name, parts in scores["iou"].items():
        values = [parts[part][key] for part in PARTS for key in (*CLASS_NAMES, "mean")]
        lines.append(f"{name:22}" + "".join(f"{value:7.3f}" for value in values))
    lines += ["", f"{'AUROC of doubt':22}" + "".join(f"{part:>12}" for part in PARTS)]
    for score in SCORES:
        values = [scores["auroc"][part][score] for part in PARTS]
        lines.append(f"{score:22}" + "".join(f"{value:12.3f}" for value in values))
    return "\n".join(lines)


def _predictions(
    inputs: NDArray[np.uint8], is_seen: NDArray[np.bool_], members: NDArray[np.float32], majority: int
) -> dict[str, NDArray[np.int64]]:
    """Classes (N, h, w) by predictor, the trivial ones first."""
    observed = inputs.argmax(axis=1)
    return {
        "observed only": np.where(is_seen, observed, VOID),
        "observed, else majority": np.where(is_seen, observed, majority),
        **{f"member {index}": member.argmax(axis=1) for index, member in enumerate(members)},
        "ensemble": members.mean(axis=0).argmax(axis=1),
    }


def _measures(counts: NDArray[np.int64]) -> dict[str, float]:
    hit = np.diag(counts).astype(np.float64)
    union = counts.sum(axis=0) + counts.sum(axis=1) - hit
    iou = hit / np.maximum(union, 1.0)
    measures = {name: float(value) for name, value in zip(CLASS_NAMES, iou, strict=True)}
    return {**measures, "mean": float(iou.mean()), "accuracy": float(hit.sum() / max(counts.sum(), 1))}


class _Ranked:
    """A random share of the cells with the doubt about them."""

    def __init__(self, rng: np.random.Generator, num_cells: int) -> None:
        self._rng, self._share = rng, min(1.0, RANKED_CELLS / num_cells)
        self._doubt: dict[str, list[NDArray[np.float32]]] = {score: [] for score in SCORES}
        self._wrong: list[NDArray[np.bool_]] = []
        self._seen: list[NDArray[np.bool_]] = []

    def add(
        self, members: NDArray[np.float32], is_wrong: NDArray[np.bool_], is_seen: NDArray[np.bool_]
    ) -> None:
        """Draw from cells: (members, 3, N, h, w), (N, h, w) and (N, h, w)."""
        chosen = self._rng.random(is_wrong.shape) < self._share
        for score in SCORES:
            self._doubt[score].append(doubt(members[:, :, chosen], score))
        self._wrong.append(is_wrong[chosen])
        self._seen.append(is_seen[chosen])

    def aurocs(self) -> dict[str, dict[str, float]]:
        wrong, seen = np.concatenate(self._wrong), np.concatenate(self._seen)
        doubts = {score: np.concatenate(values) for score, values in self._doubt.items()}
        return {
            part: {score: auroc(values[chosen], wrong[chosen]) for score, values in doubts.items()}
            for part, chosen in (("all", np.ones_like(seen)), ("unobserved", ~seen))
        }
