"""Frontiers: connected runs of free cells that touch the unknown."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from anm_gym.sim.grid import GridFrame

OUTLOOK_M = 0.4
"""Unknown cells this near to the middle of a frontier tell which way it faces, metres."""
_EIGHT = np.ones((3, 3), bool)


@dataclass(frozen=True, eq=False)
class Frontier:
    """A connected run of free cells that touch the unknown."""

    cells: NDArray[np.int64]
    """(K, 2) cells [row, column]."""
    center_xz: NDArray[np.float64]
    """(2,) its cell nearest to the mean of all, metres."""
    outward_rad: float
    """Heading that looks from there into the unknown, radians."""
    size_m: float
    """Length: number of cells times their edge, metres."""


def find_frontiers(
    free: NDArray[np.bool_],
    unknown: NDArray[np.bool_],
    frame: GridFrame,
    min_size_m: float,
    max_size_m: float = float("inf"),
) -> list[Frontier]:
    """Find the frontiers of a grid.

    Args:
        free: (rows, columns) cells known to be free.
        unknown: (rows, columns) cells never seen.
        frame: Where the cells lie.
        min_size_m: Shorter frontiers are dropped, metres.
        max_size_m: Longer frontiers are cut across into equal parts no longer than this, metres.

    Returns:
        Frontiers in the order of their first cells.

    Raises:
        ValueError: If the two rasters have different shapes, `min_size_m` is negative or `max_size_m` not
            positive.

    Source:
        Yamauchi, A frontier-based approach for autonomous exploration, 1997; cutting is ours.
    """
    if free.shape != unknown.shape:
        raise ValueError(
            f"`free` and `unknown` must have the same shape, got {free.shape} and {unknown.shape}"
        )
    if min_size_m < 0.0 or max_size_m <= 0.0:
        raise ValueError(f"`min_size_m` must be >= 0 and `max_size_m` > 0, got {min_size_m} and {max_size_m}")
    labels, count = ndimage.label(free & ndimage.binary_dilation(unknown), structure=_EIGHT)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    windows = ndimage.find_objects(labels)
    frontiers = []
    for label in np.flatnonzero(sizes[1:] * frame.cell_m >= min_size_m - 1e-9) + 1:
        window = windows[label - 1]
        cells = np.add(np.argwhere(labels[window] == label), [window[0].start, window[1].start])
        parts = int(np.ceil(len(cells) * frame.cell_m / max_size_m - 1e-9))
        frontiers += [_frontier(part, unknown, frame) for part in _cut(cells, max(1, parts))]
    return frontiers


def _cut(cells: NDArray[np.int64], parts: int) -> list[NDArray[np.int64]]:
    """Cut a run into equal parts across its longest direction."""
    if parts == 1:
        return [cells]
    centered = cells - cells.mean(axis=0)
    _, directions = np.linalg.eigh(centered.T @ centered)
    order = np.argsort(centered @ directions[:, -1], kind="stable")
    return [cells[part] for part in np.array_split(order, parts)]


def _frontier(cells: NDArray[np.int64], unknown: NDArray[np.bool_], frame: GridFrame) -> Frontier:
    middle = cells[((cells - cells.mean(axis=0)) ** 2).sum(axis=1).argmin()]
    reach = max(1, round(OUTLOOK_M / frame.cell_m))
    low = np.maximum(middle - reach, 0)
    window = unknown[low[0] : middle[0] + reach + 1, low[1] : middle[1] + reach + 1]
    outward = (np.argwhere(window) + low - middle).mean(axis=0)
    return Frontier(
        cells=cells,
        center_xz=frame.centers_of(middle)[0],
        outward_rad=float(np.arctan2(-outward[1], -outward[0])),
        size_m=len(cells) * frame.cell_m,
    )
