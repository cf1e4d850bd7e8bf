"""CPU time of every module over the steps of an episode (Fig. 7)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from train.figures.map_probe import Moment, Numbers, Trace
from train.plots import PALETTE, save_figure
from train.recorder import env_layers, find_attribute

ORDER: Final = ("learn", "observe", "goal", "plan", "render", "occupancy")
"""Modules from the top of the figure down; others follow."""
MEANINGS: Final = {
    "learn": "learn: iterations on the map",
    "observe": "observe: keyframe test, volume, cloud",
    "goal": "goal: variability, target view",
    "plan": "plan: way to the goal",
    "render": "render: depth image, motion",
    "occupancy": "occupancy: contacts",
}
MIN_SHARE: Final = 0.001
"""Modules with a smaller share of the time are left out of the picture."""


@dataclass(frozen=True, eq=False)
class Compute:
    """The figure."""

    step_ms: dict[str, NDArray[np.float64]]
    """(T,) CPU milliseconds of each step by module."""
    keyframes: NDArray[np.int64]
    """Steps at which a keyframe was kept, from 1."""
    replans: NDArray[np.int64]
    """Steps at which another goal was set, from 1."""

    @property
    def mean_ms(self) -> dict[str, float]:
        """Mean per step by module."""
        return {name: float(values.mean()) for name, values in self.step_ms.items()}

    @property
    def share_pct(self) -> dict[str, float]:
        """Share of each module in the sum of all, per cent."""
        total = max(sum(self.mean_ms.values()), 1e-12)
        return {name: 100.0 * value / total for name, value in self.mean_ms.items()}

    def numbers(self) -> Numbers:
        """Plain values and arrays behind the picture."""
        return {**vars(self), "mean_ms": self.mean_ms, "share_pct": self.share_pct}

    def draw(self, path: Path) -> Path:
        """Draw one row per module, with its mean share."""
        return _draw(self, path)


class ComputeTrace(Trace):
    """Read every stopwatch after every step; what the start took is left out."""

    def __init__(self, steps: int, seed: int) -> None:  # noqa: ARG002
        self._totals: list[dict[str, float]] = []
        self._keyframes: list[int] = []
        self._replans: list[int] = []
        self._goals = 0

    def take(self, moment: Moment) -> None:
        """Take note of the totals so far, and of what may explain an impulse."""
        self._totals.append(total_ms(moment))
        goals = len(find_attribute(moment.env, "goals") or [])
        if moment.step and moment.info["is_keyframe"]:
            self._keyframes.append(moment.step)
        if moment.step and goals > self._goals:
            self._replans.append(moment.step)
        self._goals = goals

    def finish(self, moment: Moment) -> Compute:  # noqa: ARG002
        """Take differences of the totals."""
        seen = {name: None for totals in self._totals for name in totals}
        names = [*(name for name in ORDER if name in seen), *(name for name in seen if name not in ORDER)]
        table = np.array([[totals.get(name, 0.0) for name in names] for totals in self._totals])
        return Compute(
            step_ms=dict(zip(names, np.diff(table, axis=0).T, strict=True)),
            keyframes=np.array(self._keyframes, np.int64),
            replans=np.array(self._replans, np.int64),
        )


def total_ms(moment: Moment) -> dict[str, float]:
    """Add up the CPU milliseconds since the start by module, over all wrappers and the policy."""
    totals: dict[str, float] = {}
    for owner in (*env_layers(moment.env), moment.policy):
        for module, spent_ms in getattr(owner, "compute_ms", {}).items():
            totals[module] = totals.get(module, 0.0) + spent_ms
    return totals


def _draw(result: Compute, path: Path) -> Path:
    from matplotlib.figure import Figure

    shown = [name for name, share in result.share_pct.items() if share >= 100.0 * MIN_SHARE]
    sheet = Figure(figsize=(11.0, 1.0 + 1.15 * len(shown)), layout="constrained")
    grid = sheet.add_gridspec(len(shown), 2, width_ratios=(4.2, 1.0))
    axes: list[Any] = []
    for row, name in enumerate(shown):
        axes.append(sheet.add_subplot(grid[row, 0], sharex=axes[0] if axes else None))
        _draw_module(axes[-1], result, name, PALETTE[row % len(PALETTE)])
        axes[-1].tick_params(labelbottom=row == len(shown) - 1)
    axes[-1].set_xlabel("step")
    sheet.supylabel("CPU time (ms per step)", fontsize=10)
    _draw_shares(sheet.add_subplot(grid[:, 1]), result, shown)
    return save_figure(sheet, path)


def _draw_module(axis: Any, result: Compute, name: str, color: str) -> None:
    values = result.step_ms[name]
    steps = np.arange(1, len(values) + 1)
    axis.grid(True, color="#e5e5e5", linewidth=0.8)
    axis.spines[["top", "right"]].set_visible(False)
    axis.vlines(steps, 0.0, values, color=color, linewidth=1.1)
    axis.set_title(MEANINGS.get(name, name), fontsize=9, loc="left", pad=3)
    axis.set_xlim(0, len(values) + 1)
    top = 1.2 * max(float(values.max()), 1e-3)
    axis.set_ylim(0.0, top)
    marks = {"learn": result.keyframes, "goal": result.replans}.get(name)
    if marks is not None and len(marks):
        label = "goal replaced" if name == "goal" else "keyframe"
        axis.scatter(
            marks, np.full(len(marks), 0.95 * top), marker="v", s=14, color="#333333", label=label, zorder=3
        )
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), frameon=False, fontsize=8, borderpad=0.0)


def _draw_shares(axis: Any, result: Compute, shown: list[str]) -> None:
    places = np.arange(len(shown))[::-1]
    means = [result.mean_ms[name] for name in shown]
    colors = [PALETTE[row % len(PALETTE)] for row in range(len(shown))]
    axis.barh(places, means, color=colors, height=0.6)
    for place, name in zip(places, shown, strict=True):
        text = f" {result.mean_ms[name]:.1f} ms, {result.share_pct[name]:.1f} %"
        axis.text(0.0, place + 0.36, f"{name}:{text}", fontsize=9, va="bottom")
    total = sum(result.mean_ms.values())
    axis.set_title(f"mean of all steps: {total:.0f} ms", fontsize=10)
    axis.set_ylim(-0.5, len(shown) - 0.2)
    axis.set_yticks([])
    axis.set_xlabel("ms per step")
    axis.spines[["top", "right", "left"]].set_visible(False)
