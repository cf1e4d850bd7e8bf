"""The curve of a learner: how well it does on what it has not seen, over the steps it has learned from."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from anm_gym.metrics.intervals import mean_interval
from train.plots import PALETTE, figure, label_ends, save_figure


def learning_curve_figure(
    steps: Sequence[int],
    values_pct: Sequence[ArrayLike],
    baselines_pct: Mapping[str, float],
    label: str,
    path: Path,
) -> Path:
    """Draw mean and 95 % interval over steps, with a dashed line for each baseline, and save the PNG.

    Args:
        steps: (T,) steps learned from.
        values_pct: For each of them the values of the episodes, per cent.
        baselines_pct: Means by name, per cent.
        label: What the values are.
        path: Where the PNG goes.

    Returns:
        `path`.
    """
    sheet, (axes,) = figure(1, width_in=6.4, height_in=4.2)
    intervals = [mean_interval(np.asarray(values, np.float64)) for values in values_pct]
    mean, low, high = np.array([(each.mean, each.low, each.high) for each in intervals]).T
    axes.fill_between(steps, low, high, color=PALETTE[0], alpha=0.15, linewidth=0)
    axes.plot(steps, mean, color=PALETTE[0], linewidth=2.0, marker="o", markersize=4)
    last = max(steps[-1], 1)
    axes.set_xlim(0.0, last)
    axes.set_ylim(0.0, 100.0)
    ends = {"learned": float(mean[-1]), **baselines_pct}
    colors = {name: PALETTE[index % len(PALETTE)] for index, name in enumerate(ends)}
    for name, value_pct in baselines_pct.items():
        axes.axhline(value_pct, color=colors[name], linewidth=1.5, linestyle="--")
    label_ends(axes, [(value_pct, name, colors[name]) for name, value_pct in ends.items()], last)
    axes.set_xlabel("steps learned from")
    axes.set_ylabel(label)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value / 1000:g} k" if value else "0")
    return save_figure(sheet, path)
