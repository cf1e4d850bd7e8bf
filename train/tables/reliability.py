"""Whether a predicted deviation is right: the bins of many episodes, gathered by what was predicted."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

EDGES_M: Final = (0.0, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64, np.inf)
"""Predicted standard deviations at which bins meet, metres: each twice the one before (ours)."""


@dataclass(frozen=True)
class ReliabilityBin:
    """What was predicted within a factor of two, over all episodes."""

    predicted_m: float
    """Root mean square of the predicted standard deviations, metres."""
    error_m: float
    """Root mean square of the true errors, metres."""
    share_pct: float
    """Share of all predictions that lie in this bin, per cent."""
    lowest_ratio: float
    """Least ratio of true to predicted error in a scene."""
    highest_ratio: float
    """Greatest one."""

    @property
    def ratio(self) -> float:
        """True error over predicted deviation; above 1 the map was too sure."""
        return self.error_m / self.predicted_m


def gather_reliability(rows: Iterable[Mapping[str, Any]]) -> list[ReliabilityBin]:
    """Gather the reliability of episodes by the deviation that was predicted.

    An episode's own bins hold equally many points each, and so different deviations from one episode to the
    next: averaged by rank, they would set what one map was sure of against what another one doubted.

    Args:
        rows: Result rows; those without `reliability` are left out.

    Returns:
        The bins that hold any prediction, the surest first.
    """
    found = [(row["scene"], each) for row in rows for each in row.get("reliability") or () if each[0] > 0.0]
    if not found:
        return []
    scenes = np.array([scene for scene, _ in found])
    predicted_m, error_m, counts = np.array([each for _, each in found], np.float64).T
    bins = np.digitize(predicted_m, EDGES_M)
    result = []
    for number in np.unique(bins):
        inside = bins == number
        ratios = [
            _root_mean_square(error_m, counts, part) / _root_mean_square(predicted_m, counts, part)
            for part in (inside & (scenes == scene) for scene in np.unique(scenes[inside]))
        ]
        result.append(
            ReliabilityBin(
                _root_mean_square(predicted_m, counts, inside),
                _root_mean_square(error_m, counts, inside),
                float(100.0 * counts[inside].sum() / counts.sum()),
                min(ratios),
                max(ratios),
            )
        )
    return result


def _root_mean_square(
    values: NDArray[np.float64], counts: NDArray[np.float64], part: NDArray[np.bool_]
) -> float:
    return float(np.sqrt(np.average(values[part] ** 2, weights=counts[part])))
