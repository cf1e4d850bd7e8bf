"""Figure 5 in our reading: completion over steps for every agent of a table, with confidence bands.

The paper's figure compares three ways to choose a candidate in one run each. This one compares all agents of
`train.tables table1`, from its rows and trajectories, and so needs no episode of its own.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from train.figures.map_probe import Numbers
from train.play import ROWS_FILE
from train.plots import PALETTE, Band, Curve, band_alpha, figure, has_band, mean_band, save_figure
from train.provenance import versions
from train.report import load_curves
from train.results import Row, read_rows
from train.tables.comparison import make_table

MAX_POINTS: Final = 201
"""Points of a curve, all at whole steps."""
_LINES: Final = ("-", "--", ":")


@dataclass(frozen=True, eq=False)
class Panel:
    """The curves of the scenes that have one budget."""

    steps: int
    """Their budget."""
    scenes: tuple[str, ...]
    """Their names."""
    bands: Mapping[str, Band]
    """Mean completion ratio by agent, the best at the end first; 95 % bands are over scenes, or over the
    starts of a single one."""
    episodes: Mapping[str, int]
    """Episodes by agent."""
    has_band: bool = False
    """Whether there are enough of them for a band."""
    missing: int = 0
    """Episodes of the table that are not drawn."""
    gap: str = ""
    """How many are drawn, and why not all, in words; empty if all are."""

    @property
    def num_episodes(self) -> int:
        """Episodes that are drawn."""
        return sum(self.episodes.values())


@dataclass(frozen=True, eq=False)
class CompletionCurves:
    """The figure: a panel for each budget, since curves of unlike length have no mean."""

    protocol: str
    """Of the rows."""
    panels: tuple[Panel, ...]
    """The smallest budget first; without any curve, a panel has no bands and is not drawn."""
    num_failed: int = 0
    """Episodes of the table that raised."""

    @property
    def gap(self) -> str:
        """What is lacking: episodes that are not drawn, by budget, and failed ones; empty if nothing is."""
        lacks = [panel.gap for panel in self.panels if panel.gap]
        return "; ".join(lacks + [f"{self.num_failed} failed"] * bool(self.num_failed))

    def numbers(self) -> Numbers:
        """Give the curves as plain arrays."""
        return {
            "figure": "fig5",
            "protocol": self.protocol,
            "versions": versions(),
            "data": {"panels": [_panel_numbers(panel) for panel in self.panels]},
        }

    def draw(self, path: Path) -> Path:
        """Write the PNG."""
        panels = [panel for panel in self.panels if panel.bands]
        result, axes = figure(len(panels), width_in=6.4 * len(panels), height_in=4.6)
        names = sorted({name for panel in panels for name in panel.bands})
        styles = {
            name: (PALETTE[i % len(PALETTE)], _LINES[i // len(PALETTE) % 3]) for i, name in enumerate(names)
        }
        for axis, panel in zip(axes, panels, strict=True):
            _draw_panel(axis, panel, styles)
        axes[0].set_ylabel("completion ratio (%), mean and 95 % CI")
        return save_figure(result, path)


def gather_curves(run: Path) -> CompletionCurves:
    """Read the curves of a table's episodes.

    Args:
        run: Folder of the run, with rows and trajectories.

    Raises:
        FileNotFoundError: If there are no rows, or none of them has a curve or its trajectory.
        ValueError: If the rows cannot be compared, see `train.tables.comparison.make_table`.
    """
    played = read_rows(run / ROWS_FILE)
    rows = [row for row in played if not row.get("error")]
    if not rows:
        raise FileNotFoundError(
            f"{run} must hold the rows of a table, got none; run `python -m train.tables table1 --out {run}`"
        )
    table = make_table(rows)
    by_budget: dict[int, list[Row]] = defaultdict(list)
    for row in rows:
        by_budget[row["steps"]].append(row)
    panels = tuple(_panel(run, steps, by_budget[steps]) for steps in sorted(by_budget))
    if not any(panel.bands for panel in panels):
        raise FileNotFoundError(
            f"{run} must hold curves or trajectories of a start that all its agents have, got none in "
            f"{len(rows)} episodes; copy them there, or play the episodes again in an empty folder with "
            "`python -m train.tables table1`"
        )
    return CompletionCurves(table.protocol, panels, len(played) - len(rows))


def _panel(run: Path, steps: int, rows: Sequence[Row]) -> Panel:
    loaded = load_curves(run, rows, steps)
    x = _whole_steps(steps)
    bands = {name: _band(found, x) for name, found in loaded.over_steps.items()}
    best_first = sorted(bands, key=lambda name: -bands[name].mean[-1])
    return Panel(
        steps,
        tuple(sorted({row["scene"] for row in rows})),
        {name: bands[name] for name in best_first},
        {name: len(loaded.over_steps[name]) for name in best_first},
        all(map(has_band, loaded.over_steps.values())),
        loaded.missing + loaded.unshared,
        loaded.gap,
    )


def _band(curves: Sequence[Curve], x: Any) -> Band:
    """Mean and band, within what a ratio can be."""
    band = mean_band(curves, x)
    return Band(x, band.mean, np.clip(band.low, 0.0, 100.0), np.clip(band.high, 0.0, 100.0))


def _panel_numbers(panel: Panel) -> Numbers:
    agents = {
        name: {"episodes": panel.episodes[name], "mean": band.mean, "low": band.low, "high": band.high}
        for name, band in panel.bands.items()
    }
    steps = _whole_steps(panel.steps)
    head = {"budget": panel.steps, "scenes": panel.scenes, "episodes_missing": panel.missing}
    return {**head, "step": steps, "comp_pct": agents}


def _whole_steps(budget: int) -> NDArray[np.float64]:
    return np.unique(np.linspace(0.0, float(budget), MAX_POINTS).round())


def _draw_panel(axis: Any, panel: Panel, styles: Mapping[str, tuple[str, str]]) -> None:
    for name, band in panel.bands.items():
        color, line = styles[name]
        if panel.has_band:
            axis.fill_between(
                band.x, band.low, band.high, color=color, alpha=band_alpha(len(panel.bands)), linewidth=0
            )
        label = f"{name} ({band.mean[-1]:.0f} %)"
        axis.plot(band.x, band.mean, color=color, linestyle=line, linewidth=1.8, label=label)
    axis.set_xlim(0.0, panel.steps)
    axis.set_ylim(0.0, 100.0)
    axis.set_xlabel("steps")
    count = len(panel.scenes)
    total = panel.num_episodes + panel.missing
    title = [f"{count} scene{'s' if count > 1 else ''}", f"{panel.steps} steps"]
    title += [f"{panel.num_episodes} of {total} episodes"] * bool(panel.missing)
    axis.set_title(", ".join(title), fontsize=10)
    axis.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
