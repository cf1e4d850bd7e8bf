"""Frontiers: connected runs of reachable free cells that touch the unknown."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from anm_gym.sim.grid import GridFrame

_EIGHT = np.ones((3, 3), bool)


@dataclass(frozen=True, eq=False)
class Frontier:
    """One connected frontier."""

    cells: NDArray[np.int64]
    """(K, 2) cells [row, column]."""
    center_xz: NDArray[np.float64]
    """(2,) the frontier cell nearest to the mean of all, metres."""
    outward_rad: float
    """Heading that looks from the frontier into the unknown, radians."""
    size_m: float
    """Length: number of cells times their edge, metres."""


def find_frontiers(
    free: NDArray[np.bool_], unknown: NDArray[np.bool_], frame: GridFrame, min_size_m: float
) -> list[Frontier]:
    """Find the frontiers of a grid.

    Args:
        free: (rows, columns) cells known to be free.
        unknown: (rows, columns) cells never seen.
        frame: Where the cells lie.
        min_size_m: Shorter frontiers are dropped, metres.

    Returns:
        Frontiers, longest first.

    Source:
        Yamauchi, A frontier-based approach for autonomous exploration, 1997.
    """
    beside_unknown = ndimage.binary_dilation(unknown)
    labels, count = ndimage.label(free & beside_unknown, structure=_EIGHT)
    frontiers = []
    for label, window in enumerate(ndimage.find_objects(labels), start=1):
        cells = np.argwhere(labels[window] == label) + [window[0].start, window[1].start]
        if len(cells) * frame.cell_m >= min_size_m:
            frontiers.append(_frontier(cells, unknown, frame))
    return sorted(frontiers, key=lambda frontier: -frontier.size_m)


def _frontier(cells: NDArray[np.int64], unknown: NDArray[np.bool_], frame: GridFrame) -> Frontier:
    middle = cells[((cells - cells.mean(axis=0)) ** 2).sum(axis=1).argmin()]
    reach = 8
    low = np.maximum(middle - reach, 0)
    window = unknown[low[0] : middle[0] + reach + 1, low[1] : middle[1] + reach + 1]
    outward = np.argwhere(window).mean(axis=0) + low - middle if window.any() else np.array([0.0, 0.0])
    return Frontier(
        cells=cells,
        center_xz=frame.centers_of(middle)[0],
        outward_rad=float(np.arctan2(-outward[1], -outward[0])),
        size_m=len(cells) * frame.cell_m,
    )
