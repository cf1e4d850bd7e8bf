"""Curves over steps and metres, mean and confidence band per agent, and the look of every figure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.metrics.intervals import mean_interval
from anm_gym.whole_file import whole_file
from train.tables.reliability import ReliabilityBin

PALETTE: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#555555")
"""Okabe and Ito's colours, told apart by every kind of colour vision."""
STROKES: Final = (("-", ""), ("--", "– – "), (":", "··· "))
"""Line styles of curves whose colours repeat, and the signs before their labels."""

MIN_BAND_CURVES: Final = 3
"""Fewer scenes, or curves of a single one, have intervals too wide to be drawn."""

MAX_BAND_ALPHA: Final = 0.15
"""Opacity of a band."""
BANDS_ALPHA: Final = 0.4
"""Opacity of all bands together: many of them would hide the curves."""

_MARKERS: Final = ("o", "s", "^", "D", "v", "P", "X")
_SMALLEST_M: Final = 1e-5
_TEXT: Final = "#333333"
_GRID: Final = "#e5e5e5"


@dataclass(frozen=True, eq=False)
class Curve:
    """One episode's value over steps or metres, straight between its points and constant after its end."""

    x: NDArray[np.float64]
    """(T,) not decreasing."""
    y: NDArray[np.float64]
    """(T,)."""
    scene: str = ""
    """Where it was played."""

    def at(self, x: ArrayLike) -> NDArray[np.float64]:
        """Read the curve between its points; of points at the same `x` the last one counts."""
        last = np.append(np.diff(self.x) > 0.0, True)
        return np.asarray(np.interp(np.asarray(x, np.float64), self.x[last], self.y[last]), np.float64)


@dataclass(frozen=True, eq=False)
class Band:
    """Mean of several curves with its 95 % confidence band; the band is NaN for a single curve."""

    x: NDArray[np.float64]
    mean: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def mean_band(curves: Sequence[Curve], x: NDArray[np.float64]) -> Band:
    """Average curves on a common axis, with a 95 % t-interval over scenes, or over the curves of one.

    Args:
        curves: At least one curve.
        x: (K,) common axis.

    Returns:
        (K,) arrays; without a second curve there is no interval and the band is NaN.
    """
    values = np.stack([curve.at(x) for curve in curves])
    scenes = [curve.scene for curve in curves]
    intervals = [mean_interval(column, clusters=scenes) for column in values.T]
    mean, low, high = np.array([(each.mean, each.low, each.high) for each in intervals]).T
    return Band(x, mean, low, high)


def has_band(curves: Sequence[Curve]) -> bool:
    """Whether the interval of some curves is to be drawn; see `MIN_BAND_CURVES`."""
    scenes = {curve.scene for curve in curves}
    return (len(scenes) if len(scenes) > 1 else len(curves)) >= MIN_BAND_CURVES


def band_alpha(num_bands: int) -> float:
    """Opacity at which so many bands leave the curves to be seen."""
    return min(MAX_BAND_ALPHA, BANDS_ALPHA / max(num_bands, 1))


def plot_curves(
    axes: Any,
    groups: Mapping[str, Sequence[Curve]],
    x_max: float,
    x_label: str,
    y_label: str,
    first: bool = True,
    y_max: float = 100.0,
) -> None:
    """Draw one labelled line with its band per group into matplotlib axes.

    Args:
        axes: The axes.
        groups: By name, its curves; a line begins where all of its group do.
        x_max: Right end of the axis, which begins at 0.
        x_label: What is on it.
        y_label: What is on the other.
        first: Whether these are the leftmost axes, which alone are labelled on the left.
        y_max: The y axis, which begins at 0 and fits the curves, reaches no higher.
    """
    ends = []
    for index, (name, curves) in enumerate(groups.items()):
        x = np.linspace(max(float(curve.x[0]) for curve in curves), x_max, 201)
        color = PALETTE[index % len(PALETTE)]
        band = mean_band(curves, x)
        if has_band(curves):
            axes.fill_between(x, band.low, band.high, color=color, alpha=band_alpha(len(groups)), linewidth=0)
        dashes, sign = STROKES[index // len(PALETTE) % len(STROKES)]
        axes.plot(x, band.mean, color=color, linewidth=2.0, linestyle=dashes)
        ends.append((float(band.mean[-1]), sign + name, color))
    axes.set_xlim(0.0, x_max)
    axes.set_ylim(0.0, min(1.05 * max([1.0, *(float(curve.y.max()) for curve in _all(groups))]), y_max))
    label_ends(axes, ends, x_max)
    axes.set_xlabel(x_label)
    if first:
        axes.set_ylabel(y_label)


def figure(columns: int, width_in: float = 9.0, height_in: float = 3.6) -> tuple[Any, list[Any]]:
    """Make a figure in the house's look: light grid, no box.

    Returns:
        The figure and its list of axes.
    """
    from matplotlib.figure import Figure

    result = Figure(figsize=(width_in, height_in), layout="constrained")
    axes = [result.add_subplot(1, columns, index + 1) for index in range(columns)]
    for axis in axes:
        axis.grid(True, color=_GRID, linewidth=0.8)
        axis.set_axisbelow(True)
        axis.spines[["top", "right"]].set_visible(False)
        axis.tick_params(colors=_TEXT, length=0)
    return result, axes


def completion_figure(
    over_steps: Mapping[str, Sequence[Curve]],
    over_metres: Mapping[str, Sequence[Curve]],
    steps: int,
    path: Path,
) -> Path:
    """Draw completion over steps and over metres, side by side, and save the PNG.

    Args:
        over_steps: Curves by agent, x in steps.
        over_metres: Curves by agent, x in metres.
        steps: Budget of the episodes.
        path: Where the PNG goes.

    Returns:
        `path`.
    """
    result, (left, right) = figure(2)
    longest_m = max((float(curve.x[-1]) for curves in over_metres.values() for curve in curves), default=1.0)
    label = "completion ratio (%), mean and 95 % CI"
    plot_curves(left, over_steps, float(steps), "steps", label)
    plot_curves(right, over_metres, max(longest_m, 1e-3), "path length (m)", label, first=False)
    return save_figure(result, path)


def reliability_figure(curves: Mapping[str, Sequence[ReliabilityBin]], path: Path) -> Path:
    """Draw true against predicted errors on logarithmic axes, one line per group, and save the PNG.

    Args:
        curves: By group, its bins; bars reach from the lowest to the highest scene of each.
        path: Where the PNG goes.

    Returns:
        `path`.
    """
    result, (axes,) = figure(1, width_in=7.6, height_in=4.6)
    axes.axline((1.0, 1.0), (10.0, 10.0), color=_TEXT, linewidth=1.0, linestyle=":", label="as predicted")
    errors = []
    for index, (name, bins) in enumerate(curves.items()):
        predicted_cm = 100.0 * np.array([each.predicted_m for each in bins])
        ratios = np.array([(each.ratio, each.lowest_ratio, each.highest_ratio) for each in bins]).T
        error_cm, low_cm, high_cm = np.maximum(predicted_cm * ratios, 100.0 * _SMALLEST_M)
        color, line = PALETTE[index % len(PALETTE)], ("-", "--")[index // len(PALETTE) % 2]
        look = {"color": color, "linewidth": 2.0, "marker": "o", "markersize": 4.5, "label": name}
        beside = 1.03 ** (index - (len(curves) - 1) / 2)  # so that bars of groups do not cover each other
        axes.vlines(predicted_cm * beside, low_cm, high_cm, color=color, alpha=0.5, linewidth=1.0)
        axes.plot(predicted_cm * beside, error_cm, line, **look)
        errors += [low_cm, high_cm]
    predicted_m = [each.predicted_m for bins in curves.values() for each in bins]
    _make_logarithmic(axes, "x", 100.0 * np.array(predicted_m))
    _make_logarithmic(axes, "y", np.concatenate(errors))
    axes.set_xlabel("predicted standard deviation (cm)")
    axes.set_ylabel("root mean square error (cm), range over scenes")
    axes.legend(frameon=False, fontsize=9, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return save_figure(result, path)


def tradeoff_figure(
    points: Mapping[str, Mapping[str, float]],
    x: tuple[str, str],
    measures: Sequence[tuple[str, str]],
    path: Path,
) -> Path:
    """Draw several errors over one cost on a logarithmic axis, one marker per group, and save the PNG.

    Args:
        points: By group, values by key.
        x: Key and label of the cost.
        measures: Key and label of each error, a panel each; lower is better.
        path: Where the PNG goes.

    Returns:
        `path`.
    """
    result, panels = figure(len(measures), width_in=3.4 * len(measures), height_in=3.8)
    for axes, (key, label) in zip(panels, measures, strict=True):
        for index, (name, values) in enumerate(points.items()):
            look = {"color": PALETTE[index % len(PALETTE)], "marker": _MARKERS[index % len(_MARKERS)]}
            axes.plot(
                values[x[0]],
                values[key],
                markersize=9,
                markeredgecolor="white",
                linestyle="none",
                label=name,
                **look,
            )
        axes.margins(0.2)
        axes.set_ylim(bottom=0.0)
        _make_logarithmic(axes, "x", [values[x[0]] for values in points.values()])
        axes.set_xlabel(x[1])
        axes.set_ylabel(label)
    names, count = panels[0].get_legend_handles_labels(), len(points)
    result.legend(*names, loc="outside upper center", ncols=max(1, min(count, 7)), frameon=False, fontsize=10)
    return save_figure(result, path)


def _make_logarithmic(axes: Any, name: str, values: ArrayLike) -> None:
    """Make the axis called `name` logarithmic around positive values, with plain numbers at its ticks."""
    from matplotlib.ticker import LogLocator

    positive = np.asarray(values, np.float64)
    middle = float(np.sqrt(positive.min() * positive.max()))
    low, high = min(positive.min() / 1.5, middle / 4.0), max(positive.max() * 1.5, middle * 4.0)
    axes.set(**{f"{name}scale": "log", f"{name}lim": (low, high)})
    axis = getattr(axes, f"{name}axis")
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 50.0 * low else (1.0,)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(LogLocator(subs=()))


def save_figure(result: Any, path: Path) -> Path:
    """Write a figure as a PNG, and make its folder; returns the path."""
    with whole_file(path) as draft:
        result.savefig(draft, dpi=150, format="png")
    return path


def _all(groups: Mapping[str, Sequence[Curve]]) -> list[Curve]:
    return [curve for curves in groups.values() for curve in curves]


def label_ends(axes: Any, ends: Sequence[tuple[float, str, str]], x_max: float) -> None:
    """Write names at the right ends of lines, spread so that no two touch.

    Args:
        axes: The axes, with their limits.
        ends: For each line, the value at its end, its name and its colour.
        x_max: Where the lines end.
    """
    low, high = axes.get_ylim()
    ordered = sorted(ends)
    places = spread_labels([value for value, _, _ in ordered], 0.065 * (high - low), high)
    for (value, name, color), place in zip(ordered, places, strict=True):
        axes.annotate(
            name,
            xy=(x_max, value),
            xytext=(1.01 * x_max, place),
            color=color,
            fontsize=9,
            fontweight="bold",
            va="center",
            annotation_clip=False,
        )


def spread_labels(values: Sequence[float], spacing: float, highest: float) -> list[float]:
    """Places near ascending values, at least `spacing` apart and none above `highest`."""
    places: list[float] = []
    for value in values:
        places.append(max(value, places[-1] + spacing) if places else value)
    limit = highest
    for index in reversed(range(len(places))):
        places[index] = min(places[index], limit)
        limit = places[index] - spacing
    return places
