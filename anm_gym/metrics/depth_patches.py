"""Boxes around what small squares of pixels show: most of a wide window is ruled out without a look at it."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from anm_gym.metrics.depth_view import DepthView
from anm_gym.metrics.pooling import pooled

PATCH_PX: Final = 4
"""Edge of a square, pixels."""
_FAR_M: Final = np.float32(1e9)
_SLACK_M: Final = np.float32(1e-5)


class DepthPatches:
    """Axis-aligned boxes, in the camera frame, around the points of each patch of a frame."""

    def __init__(self, view: DepthView) -> None:
        """Find the boxes.

        Args:
            view: The frame; a patch without a depth is beyond everything.
        """
        near_m = pooled(np.minimum, np.where(view.is_valid, view.depth_m, _FAR_M), PATCH_PX)
        far_m = np.where(near_m == _FAR_M, _FAR_M, pooled(np.maximum, view.depth_m, PATCH_PX))
        left, right = _rims(view.depth_m.shape[1], view.center_column, view.focal)
        top, bottom = _rims(view.depth_m.shape[0], view.center_row, view.focal)
        across_low, across_high = _extent(left, right, near_m, far_m)
        down_low, down_high = _extent(top[:, None], bottom[:, None], near_m, far_m)
        self.columns = near_m.shape[1]
        """Patches side by side; they are numbered row by row."""
        self._low = np.stack([across_low.ravel(), -down_high.ravel(), near_m.ravel()])
        self._high = np.stack([across_high.ravel(), -down_low.ravel(), far_m.ravel()])

    def in_reach(
        self, patch: NDArray[np.integer], camera_points: NDArray[np.float32], radius_m: NDArray[np.float32]
    ) -> NDArray[np.bool_]:
        """Tell whether a patch can have a point within a distance of a sample.

        Args:
            patch: (K,) numbers of patches.
            camera_points: (3, K) float32 x, y and depth of a sample each, metres.
            radius_m: (K,) the distance, metres.

        Returns:
            (K,) bool; False is certain.
        """
        squared = np.zeros(len(patch), np.float32)
        for low, high, place in zip(self._low, self._high, camera_points, strict=True):
            gap = np.maximum(low[patch] - place, place - high[patch])
            squared += np.maximum(gap, 0.0, out=gap) ** 2
        return np.asarray(squared < (radius_m + _SLACK_M) ** 2)


def _rims(count: int, center: float, focal: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Slopes of the first and the last pixel of the patches along a side."""
    first = np.arange(0, count, PATCH_PX)
    last = np.minimum(first + PATCH_PX - 1, count - 1)
    return ((first - center) / focal).astype(np.float32), ((last - center) / focal).astype(np.float32)


def _extent(
    first: NDArray[np.float32],
    last: NDArray[np.float32],
    near_m: NDArray[np.float32],
    far_m: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Lowest and highest offset from the axis between two slopes and two depths."""
    low = np.where(first < 0.0, first * far_m, first * near_m)
    return low, np.where(last < 0.0, last * near_m, last * far_m)
