"""Which depths there are around a pixel, at several distances: one look-up tells what is out of reach."""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from anm_gym.metrics.depth_view import DepthView
from anm_gym.metrics.pooling import pooled

_SPREADS: Final = {2: range(1, 7), 8: range(2, 5)}
"""Edge of the cells that pixels are pooled to, and how often their bins are spread to all neighbours."""
_LEVELS: Final = [(edge, count) for edge, counts in _SPREADS.items() for count in counts]
_RADII_PX: Final = np.array([edge * count for edge, count in _LEVELS], np.float32)
"""Distance up to which a level holds all bins around a pixel."""
_SHIFTS: Final = np.array([*(edge.bit_length() - 1 for edge, _ in _LEVELS), 31], np.int32)
"""By how many bits a row or column is shifted to its cell; beyond the last level there is but one."""
_BESIDE: Final = np.array(
    [sum(1 << (index + step) % 64 for step in (-1, 0, 1)) for index in range(64)], np.uint64
)
"""The bits of each bin and the two beside it."""
_SLACK: Final = 1.01
"""Bins are wider than the reach by so much, lest rounding puts two depths in reach two bins apart."""


class DepthBins:
    """The bins of depth that occur around each pixel, as the bits of a number.

    A bin is as wide as the reach, so depths within reach are in the same bin or in one beside it. There are
    64 bins; a depth 64 bins farther away shares one, which rules out less, never too much.
    """

    def __init__(self, view: DepthView, reach_m: float) -> None:
        """Pool a frame to cells and spread their bins.

        Args:
            view: The frame; its empty pixels are in no bin.
            reach_m: Difference of depth up to which `may_touch` looks, metres.
        """
        self._bin_m = np.float32(_SLACK * reach_m)
        bits = np.where(view.is_valid, np.uint64(1) << self._bins(view.depth_m), np.uint64(0))
        self._last_pixel = np.array(view.depth_m.shape, np.int32) - 1
        levels = list(_spread_levels(bits))
        self._bits = np.concatenate([*(cells.ravel() for cells in levels), [~np.uint64(0)]])
        self._widths = np.array([*(cells.shape[1] for cells in levels), 0], np.int32)
        self._offsets = np.cumsum([0, *(cells.size for cells in levels)], dtype=np.int32)

    def may_touch(
        self,
        row: NDArray[np.float32],
        column: NDArray[np.float32],
        radius_px: NDArray[np.float32],
        depth_m: NDArray[np.float32],
    ) -> NDArray[np.bool_]:
        """Tell which points can have a pixel of about their own depth around them.

        Args:
            row: (N,) float32 row index of the points' projections; may lie outside the image.
            column: (N,) float32 column index.
            radius_px: (N,) float32 how far around the projection to look, pixels; beyond 32 the answer is
                True.
            depth_m: (N,) float32 planar depth of the points, metres, not negative.

        Returns:
            (N,) bool; False is certain.
        """
        rows = np.rint(np.clip(row, 0, self._last_pixel[0])).astype(np.int32)
        columns = np.rint(np.clip(column, 0, self._last_pixel[1])).astype(np.int32)
        level = np.searchsorted(_RADII_PX, radius_px + np.float32(0.5))
        shift = _SHIFTS[level]
        cell = self._offsets[level] + (rows >> shift) * self._widths[level] + (columns >> shift)
        return np.asarray((self._bits[cell] & _BESIDE[self._bins(depth_m)]) != 0)

    def _bins(self, depth_m: NDArray[np.float32]) -> NDArray[np.uint64]:
        """The bin of each depth, from 0 to 63."""
        return np.asarray((depth_m / self._bin_m).astype(np.uint64) & np.uint64(63))


def _spread_levels(bits: NDArray[np.uint64]) -> Iterator[NDArray[np.uint64]]:
    """Yield the cells of each level."""
    for edge, counts in _SPREADS.items():
        cells = pooled(np.bitwise_or, bits, edge)
        for count in range(1, counts.stop):
            cells = _spread(cells)
            if count in counts:
                yield cells


def _spread(cells: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Unite the bits of each cell with those of its eight neighbours."""
    spread = cells.copy()
    spread[1:] |= cells[:-1]
    spread[:-1] |= cells[1:]
    united = spread.copy()
    united[:, 1:] |= spread[:, :-1]
    united[:, :-1] |= spread[:, 1:]
    return united
