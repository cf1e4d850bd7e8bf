"""The three terms of the objective (Eq. 3) traced over an episode."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from anm_gym.map.sampling import RayBatch
from train.figures.map_probe import Moment, Numbers, Trace, draw_rays, frozen, join_rays, predict, ray_loss
from train.plots import PALETTE, save_figure

BETA: Final = 1.0
"""Weight of the first term; the paper gives no number."""
PAST_FRAMES: Final = 48
"""Frames of the past on which the map is asked, evenly over the episode."""
PAST_RAYS: Final = 16
"""Rays of each."""
NEW_RAYS: Final = 128
"""Rays of the newest frame."""
SMOOTH_STEPS: Final = 9
"""Width of the running mean that is drawn over the values, steps."""


@dataclass(frozen=True, eq=False)
class Terms:
    """The figure: the three terms after each step t, on rays that stay the same.

    Source:
        Active Neural Mapping, Eq. 3, with the horizon of one step.
    """

    steps: NDArray[np.int64]
    """(T,) from 1."""
    past: NDArray[np.float64]
    """(T,) beta L(theta_t, z_1:t): loss on past frames before the step is learned."""
    data_shift: NDArray[np.float64]
    """(T,) loss on the newest frame minus that on past frames, at the same weights."""
    weight_change: NDArray[np.float64]
    """(T,) loss on past frames after the step minus that before it."""
    keyframes: NDArray[np.int64]
    """Steps at which a keyframe was kept."""

    def numbers(self) -> Numbers:
        """Plain values and arrays behind the picture."""
        return {**vars(self), "beta": BETA}

    def draw(self, path: Path) -> Path:
        """Draw one row per term."""
        return _draw(self, path)


class TermsTrace(Trace):
    """Ask the map on the same rays before and after every step.

    Rays of every few frames are kept from when the frame was new; they are supervised by what is known of
    the surface at the time of asking, as the map's own batches are.
    """

    def __init__(self, steps: int, seed: int) -> None:
        self._stride, self._seed = max(1, steps // PAST_FRAMES), seed
        self._past: RayBatch | None = None
        self._rows: list[tuple[int, float, float, float]] = []
        self._keyframes: list[int] = []

    def take(self, moment: Moment) -> None:
        """Evaluate the terms of the step that was just learned, and remember what the next one needs."""
        field = frozen(moment.neural_map.field)
        after = [] if self._past is None else [predict_rays(field, self._past)]
        if self._past is not None:
            if moment.info["is_keyframe"]:
                self._keyframes.append(moment.step)
            self._rows.append((moment.step, *self._terms(moment, self._past, after[0])))
        if moment.step % self._stride == 0:
            rays = self._newest(moment, PAST_RAYS)
            self._past = rays if self._past is None else join_rays([self._past, rays])
            after.append(predict_rays(field, rays))
        self._field, self._before = field, torch.cat(after)

    def finish(self, moment: Moment) -> Terms:  # noqa: ARG002
        """Gather the rows."""
        steps, past, shift, change = np.array(self._rows).reshape(-1, 4).T
        keyframes = np.array(self._keyframes, np.int64)
        return Terms(steps.astype(np.int64), BETA * past, shift, change, keyframes)

    def _terms(self, moment: Moment, past: RayBatch, prediction: Tensor) -> tuple[float, float, float]:
        newest = self._newest(moment, NEW_RAYS)
        before = ray_loss(moment.neural_map, past, self._before)
        after = ray_loss(moment.neural_map, past, prediction)
        on_newest = ray_loss(moment.neural_map, newest, predict_rays(self._field, newest))
        return before, on_newest - before, after - before

    def _newest(self, moment: Moment, rays: int) -> RayBatch:
        """Rays of the latest frame, the same in every run."""
        frames = moment.neural_map.frames
        return draw_rays(frames, len(frames) - 1, rays, seed=self._seed + moment.step)


def predict_rays(field: nn.Module, rays: RayBatch) -> Tensor:
    """Predict at every sample of (R, S) rays, (R * S,) metres."""
    return predict(field, rays.points.reshape(-1, 3))


def running_mean(values: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Average each value with its neighbours, as many as there are within a window; NaN is left out."""
    kernel = np.ones(min(width, max(len(values), 1)))
    known = np.isfinite(values)
    sums = np.convolve(np.where(known, values, 0.0), kernel, "same")
    counts = np.convolve(known.astype(float), kernel, "same")
    means = np.full(len(values), np.nan)
    np.divide(sums, counts, out=means, where=counts > 0)
    return means


def _draw(result: Terms, path: Path) -> Path:
    from matplotlib.figure import Figure

    sheet = Figure(figsize=(9.0, 6.6), layout="constrained")
    axes = sheet.subplots(3, 1, sharex=True)
    rows = (
        (result.past, r"loss on past frames: $\beta L(\theta^t, z^{1:t})$, $\beta = 1$"),
        (result.data_shift, r"data shift: $L(\theta^t, \delta z) - L(\theta^t, z^{1:t})$"),
        (
            result.weight_change,
            r"change of weights: $L(\theta^t + \delta\theta, z^{1:t}) - L(\theta^t, z^{1:t})$",
        ),
    )
    for axis, (values, title), color in zip(axes, rows, PALETTE, strict=False):
        _draw_term(axis, result, values, color)
        axis.set_title(title, fontsize=10, loc="left")
    axes[0].set_ylim(bottom=0.0)
    handles, labels = axes[0].get_legend_handles_labels()
    sheet.legend(handles, labels, loc="outside upper right", frameon=False, fontsize=9, ncols=3)
    axes[-1].set_xlabel("step $t$")
    sheet.supylabel("distance term of the map's loss", fontsize=10)
    return save_figure(sheet, path)


def _draw_term(axis: Any, result: Terms, values: NDArray[np.float64], color: str) -> None:
    axis.grid(True, color="#e5e5e5", linewidth=0.8)
    axis.spines[["top", "right"]].set_visible(False)
    for index, step in enumerate(result.keyframes):
        label = "keyframe" if index == 0 else None
        axis.axvline(step, color="#bbbbbb", linewidth=0.8, linestyle=":", label=label)
    axis.axhline(0.0, color="#333333", linewidth=0.8)
    axis.plot(result.steps, values, color=color, linewidth=0.8, alpha=0.5, label="each step")
    mean = running_mean(values, SMOOTH_STEPS)
    axis.plot(result.steps, mean, color=color, linewidth=2.0, label=f"mean of {SMOOTH_STEPS} steps")
    axis.set_xlim(0, int(result.steps[-1]))
