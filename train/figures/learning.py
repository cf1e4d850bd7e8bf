"""How the map's geometry gets better, and stays so, while the robot goes on exploring (Fig. 6)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from anm_gym.metrics.completion import CompletionMeter
from anm_gym.metrics.distance import MeshDistance
from anm_gym.metrics.map_accuracy import reconstruction_scores
from train.figures.map_probe import Moment, Numbers, Trace, still_copy
from train.plots import PALETTE, figure, save_figure

CHECKPOINTS: Final = 10
"""Times at which the map is scored, evenly over the episode."""
SAMPLES: Final = 20_000
"""Samples of the true surface, and of the reconstruction."""
VOXEL_M: Final = 0.1
"""Lattice of the reconstruction that is scored, metres."""


@dataclass(frozen=True)
class Checkpoint:
    """The map's scores at one step."""

    step: int
    """Actions taken."""
    mad_seen_cm: float
    """Mean absolute predicted distance at the true surface seen so far, centimetres."""
    mad_first_cm: float
    """The same at the surface seen until the first checkpoint."""
    fpr_pct: float
    """Share of the reconstruction farther than 5 cm from the true surface, per cent."""
    comp_pct: float
    """Completion ratio, per cent."""


@dataclass(frozen=True, eq=False)
class Learning:
    """The figure."""

    checkpoints: list[Checkpoint]
    """In the order of time."""

    def numbers(self) -> Numbers:
        """A list per measure."""
        names = Checkpoint.__dataclass_fields__
        return {name: self.values(name) for name in names}

    def values(self, name: str) -> NDArray[np.float64]:
        """One measure at all checkpoints."""
        return np.array([getattr(each, name) for each in self.checkpoints])

    def draw(self, path: Path) -> Path:
        """Draw the error of the field, the false positives, and the completion."""
        return _draw(self, path)


class LearningTrace(Trace):
    """Score the map at regular checkpoints."""

    def __init__(self, steps: int, seed: int) -> None:
        self._wanted = {max(1, round((index + 1) * steps / CHECKPOINTS)) for index in range(CHECKPOINTS)}
        self._seed = seed
        self._first: NDArray[np.bool_] | None = None
        self._checkpoints: list[Checkpoint] = []

    def take(self, moment: Moment) -> None:
        """Take note of what was seen; score the map at a checkpoint."""
        if moment.step == 0:
            self._truth = moment.scene.storey_mesh
            self._distance = MeshDistance(moment.scene.mesh)
            self._meter = CompletionMeter(self._truth, num_samples=SAMPLES)
        self._meter.observe(moment.observation["depth"], moment.camera, moment.pose)
        if moment.step in self._wanted:
            self._checkpoints.append(self._score(moment))

    def finish(self, moment: Moment) -> Learning:
        """Score the end, if it is no checkpoint."""
        if not self._checkpoints or self._checkpoints[-1].step != moment.step:
            self._checkpoints.append(self._score(moment))
        return Learning(self._checkpoints)

    def _score(self, moment: Moment) -> Checkpoint:
        neural_map, seen = still_copy(moment.neural_map), self._meter.covered.copy()
        self._first = seen if self._first is None else self._first
        surface = neural_map.mesh(VOXEL_M)
        scores = reconstruction_scores(
            surface.vertices,
            surface.faces,
            self._truth,
            np.random.default_rng(self._seed),
            SAMPLES,
            self._distance,
        )
        error_cm = np.full(len(seen), np.nan)
        points = self._meter.samples.points[seen].astype(np.float32)
        error_cm[seen] = 100.0 * np.abs(neural_map.sdf(points)) if len(points) else np.nan
        return Checkpoint(
            step=moment.step,
            mad_seen_cm=float(error_cm[seen].mean()),
            mad_first_cm=float(error_cm[self._first].mean()),
            fpr_pct=scores.fpr_pct,
            comp_pct=self._meter.comp_pct,
        )


def _draw(result: Learning, path: Path) -> Path:
    sheet, (left, middle, right) = figure(3, width_in=12.0, height_in=3.5)
    steps = result.values("step")
    top = _line(left, steps, result.values("mad_seen_cm"), PALETTE[0], "surface seen so far")
    top = max(
        top, _line(left, steps, result.values("mad_first_cm"), PALETTE[1], f"seen by step {steps[0]:.0f}")
    )
    left.set_ylim(0.0, 1.15 * top)
    left.legend(loc="lower left", frameon=False, fontsize=9)
    left.set_title("error of the field, MAD (cm)", fontsize=11)
    _line(middle, steps, result.values("fpr_pct"), PALETTE[3], "")
    middle.set_ylim(0.0, max(1.15 * float(np.nanmax(result.values("fpr_pct"))), 5.0))
    middle.set_title("false positives, FPR (%)", fontsize=11)
    _line(right, steps, result.values("comp_pct"), PALETTE[2], "")
    right.set_ylim(0.0, 100.0)
    right.set_title("completion ratio (%)", fontsize=11)
    for axis in (left, middle, right):
        axis.set_xlim(0.0, 1.03 * float(steps[-1]))
        axis.set_xlabel("step")
    return save_figure(sheet, path)


def _line(
    axis: Any, steps: NDArray[np.float64], values: NDArray[np.float64], color: str, label: str
) -> float:
    axis.plot(steps, values, color=color, linewidth=2.0, marker="o", markersize=4, label=label or None)
    return float(np.nanmax(values))
