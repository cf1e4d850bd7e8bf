"""Nearest and farthest depth around a pixel at several tile sizes: one look-up tells what is out of reach."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from anm_gym.metrics.depth_view import DepthView

_FIRST_SIDE_PX = 4
_NUM_LEVELS = 4


class DepthTiles:
    """Depth ranges over tiles of 4, 8, 16 and 32 pixels, each together with its eight neighbours."""

    def __init__(self, view: DepthView) -> None:
        """Reduce a frame to tiles.

        Args:
            view: The frame; its empty pixels are in no range.
        """
        nearest = np.where(view.is_valid, view.depth_m, np.float32(np.inf))
        farthest = view.depth_m
        ranges = []
        for level in range(_NUM_LEVELS):
            side = _FIRST_SIDE_PX if level == 0 else 2
            nearest, farthest = _reduced(nearest, np.minimum, side), _reduced(farthest, np.maximum, side)
            ranges.append((minimum_filter(nearest, 3), maximum_filter(farthest, 3)))
        self._nearest = np.concatenate([low.ravel() for low, _ in ranges] + [[np.float32(0.0)]])
        self._farthest = np.concatenate([high.ravel() for _, high in ranges] + [[np.float32(np.inf)]])
        self._widths = np.array([low.shape[1] for low, _ in ranges] + [0], np.int32)
        self._offsets = np.cumsum([0] + [low.size for low, _ in ranges], dtype=np.int32)
        self._last_pixel = np.array(view.depth_m.shape, np.int32) - 1

    def may_touch(
        self,
        row: NDArray[np.float32],
        column: NDArray[np.float32],
        radius_px: NDArray[np.float32],
        depth_m: NDArray[np.float32],
        reach_m: float,
    ) -> NDArray[np.bool_]:
        """Tell which points can have a pixel of about their own depth around them.

        Args:
            row: (N,) float32 row index of the points' projections; may lie outside the image.
            column: (N,) float32 column index.
            radius_px: (N,) float32 how far around the projection to look, pixels; beyond the largest
                tile the answer is True.
            depth_m: (N,) float32 planar depth of the points, metres.
            reach_m: Allowed difference of depth, metres.

        Returns:
            (N,) bool; False is certain.
        """
        rows = np.rint(np.clip(row, 0, self._last_pixel[0])).astype(np.int32)
        columns = np.rint(np.clip(column, 0, self._last_pixel[1])).astype(np.int32)
        sides = np.maximum((radius_px + np.float32(0.5)) / np.float32(_FIRST_SIDE_PX), np.float32(1.0))
        level = np.minimum(np.ceil(np.log2(sides)).astype(np.int32), _NUM_LEVELS)
        shift = level + np.int32(np.log2(_FIRST_SIDE_PX))
        tile = self._offsets[level] + (rows >> shift) * self._widths[level]
        tile += np.where(level < _NUM_LEVELS, columns >> shift, 0)
        is_near_enough = self._nearest[tile] <= depth_m + np.float32(reach_m)
        return np.asarray(is_near_enough & (self._farthest[tile] >= depth_m - np.float32(reach_m)))


def _reduced(image: NDArray[np.float32], reduce: np.ufunc, side: int) -> NDArray[np.float32]:
    """Reduce squares of `side` pixels to one; the last ones of a row or column may be smaller."""
    rows = reduce.reduceat(image, np.arange(0, image.shape[0], side), axis=0)
    return np.asarray(reduce.reduceat(rows, np.arange(0, image.shape[1], side), axis=1), np.float32)
