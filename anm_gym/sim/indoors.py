"""Which part of a floor is indoors, under a roof or between walls: many houses stand on open ground."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

INDOORS_M2 = 8.0
"""Area from which a part indoors comes before a larger one in the open, square metres (ours)."""
_DIRECTIONS = [(row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if row or column]
_MIN_WALLS = 7
"""Of the eight directions, those in which a place between walls meets one: a door may be open."""


def bridged(has_floor: NDArray[np.bool_], gap_cells: int) -> NDArray[np.bool_]:
    """Close the gaps in a floor that are narrow enough.

    Many models have a floor for each room that ends at its walls, and none under the doors.

    Args:
        has_floor: (rows, columns) bool.
        gap_cells: Width of the widest gap that is closed.

    Returns:
        (rows, columns) bool.

    Source:
        Ours: a morphological closing.
    """
    size = gap_cells + 1
    padded = np.pad(has_floor, size).astype(np.uint8)
    closed = ndimage.minimum_filter(ndimage.maximum_filter(padded, size), size, origin=-1 + size % 2)
    return np.asarray(closed[size:-size, size:-size] > 0)


def is_enclosed(
    part: NDArray[np.bool_], occupied: NDArray[np.bool_], open_floor: NDArray[np.bool_], radius_cells: float
) -> bool:
    """Tell whether a part of the floor ends at obstacles, as rooms do, rather than where the floor does.

    Args:
        part: (rows, columns) bool, where a body fits.
        occupied: (rows, columns) bool.
        open_floor: (rows, columns) bool, floor that is not occupied.
        radius_cells: Radius of the body, cells.

    Source:
        Ours.
    """
    away_cells = ndimage.distance_transform_edt(~part)
    rim = (away_cells <= radius_cells + 2.0) & ~open_floor
    return bool(occupied[rim].mean() >= 0.5) if rim.any() else False


def between_walls(occupied: NDArray[np.bool_], reach_cells: int) -> NDArray[np.bool_]:
    """Find the cells from which nearly every way leads to an obstacle.

    Args:
        occupied: (rows, columns) bool.
        reach_cells: How far away an obstacle may be, cells.

    Returns:
        (rows, columns) bool.

    Source:
        Ours.
    """
    num_walls = np.zeros(occupied.shape, np.uint8)
    for row, column in _DIRECTIONS:
        hit, covered = occupied.copy(), 0
        while covered < reach_cells:
            step = min(covered + 1, reach_cells - covered)
            hit |= _looked_up(hit, row * step, column * step)
            covered += step
        num_walls += hit
    return np.asarray(num_walls >= _MIN_WALLS)


def with_roofed_first(
    component: NDArray[np.int32], has_roof: NDArray[np.bool_], is_large: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """Label anew so that large parts mostly under a roof come first; else the order stays.

    Args:
        component: (rows, columns) labels from 1; 0 is none.
        has_roof: (rows, columns) bool.
        is_large: (labels,) bool.
    """
    sizes, roofed = (np.bincount(labels.ravel())[1:] for labels in (component, component * has_roof))
    is_indoors = is_large & (2 * np.pad(roofed, (0, len(sizes) - len(roofed))) >= sizes)
    rank = np.zeros(len(sizes) + 1, np.int32)
    rank[np.argsort(~is_indoors, kind="stable") + 1] = np.arange(1, len(sizes) + 1)
    return np.asarray(rank[component], np.int32)


def _looked_up(mask: NDArray[np.bool_], row: int, column: int) -> NDArray[np.bool_]:
    """What each cell finds so many rows and columns away; False beyond the border."""
    found, (rows, columns) = np.zeros_like(mask), mask.shape
    if abs(row) < rows and abs(column) < columns:
        target = np.s_[max(0, -row) : rows - max(0, row), max(0, -column) : columns - max(0, column)]
        source = np.s_[max(0, row) : rows + min(0, row), max(0, column) : columns + min(0, column)]
        found[target] = mask[source]
    return found
