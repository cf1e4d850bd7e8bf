"""Surface samples grouped in cubes, so that a frame looks only at the cubes in its view."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anm_gym.metrics.depth_bins import DepthBins
from anm_gym.metrics.depth_view import DepthView

BLOCK_M = 0.75
"""Side of the cubes, metres: small against a room, large against the spacing of samples."""


@dataclass(frozen=True, eq=False)
class InView:
    """The samples near which a frame may have observed something."""

    index: NDArray[np.int64]
    """(M,) int64 places in the blocks' own order."""
    camera_points: NDArray[np.float32]
    """(3, M) float32 camera coordinates x, y and depth, metres."""


class SampleBlocks:
    """Points sorted by cube; `in_view` finds those that a frame could have observed."""

    def __init__(self, points: NDArray[np.floating]) -> None:
        """Sort the points.

        Args:
            points: (N, 3), metres, world frame.

        Raises:
            ValueError: If `points` has another shape or is empty.
        """
        if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
            raise ValueError(f"`points` must have shape (N, 3) with N > 0, got {points.shape}")
        cells = np.floor(points / BLOCK_M).astype(np.int64)
        cells -= cells.min(axis=0)
        keys = np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1))
        self._order = np.argsort(keys, kind="stable")
        starts = np.flatnonzero(np.diff(keys[self._order], prepend=-1))
        self._sizes = np.diff(starts, append=len(points))
        self._points = np.ascontiguousarray(points[self._order].T, np.float32)
        low = np.minimum.reduceat(self._points, starts, axis=1)
        high = np.maximum.reduceat(self._points, starts, axis=1)
        self._centers = np.float32(0.5) * (low + high)
        self._radii_m = 0.5 * np.linalg.norm(high - low, axis=0).astype(np.float32)

    def __len__(self) -> int:
        return len(self._order)

    def in_given_order(self, values: NDArray[Any]) -> NDArray[Any]:
        """Bring values of the sorted points into the order in which the points were given."""
        given = np.empty_like(values)
        given[self._order] = values
        return given

    def in_view(self, view: DepthView, reach_m: float) -> InView:
        """Find the points that can lie within a distance of a point of the frame.

        Args:
            view: The frame.
            reach_m: The distance, metres.

        Returns:
            A superset of those points: inside the widened frustum and at about the depth of some pixel
            around their projection.
        """
        position = view.world_from_camera[:3, 3:].astype(np.float32)
        flip = np.array([[1.0], [1.0], [-1.0]], np.float32)
        rotation = view.world_from_camera[:3, :3].T.astype(np.float32) * flip
        is_near = _in_frustum(
            rotation @ (self._centers - position), view, self._radii_m + np.float32(reach_m)
        )
        index = np.flatnonzero(np.repeat(is_near, self._sizes))
        points = rotation @ (self._points[:, index] - position)
        kept = np.flatnonzero(_in_frustum(points, view, np.float32(reach_m)))
        points = points[:, kept]
        touches = np.flatnonzero(_may_touch(points, view, reach_m))
        return InView(index[kept[touches]], points[:, touches])


def _in_frustum(
    points: NDArray[np.float32], view: DepthView, margin_m: NDArray[np.float32] | np.float32
) -> NDArray[np.bool_]:
    """Tell which points (3, N) are at most a margin outside the frustum, ended by the deepest pixel."""
    x, y, depth = points
    height, width = view.depth_m.shape
    is_inside = (depth >= -margin_m) & (depth <= margin_m + view.depth_m.max())
    for across, before, after in (
        (x, view.center_column, width - 1 - view.center_column),
        (y, height - 1 - view.center_row, view.center_row),
    ):
        for sign, extent in ((-1.0, before), (1.0, after)):
            slope = np.float32(extent / view.focal)
            is_inside &= (
                np.float32(sign) * across <= slope * depth + np.hypot(np.float32(1), slope) * margin_m
            )
    return np.asarray(is_inside)


def _may_touch(points: NDArray[np.float32], view: DepthView, reach_m: float) -> NDArray[np.bool_]:
    """Rule out points (3, N) in the frustum that are occluded or in the air before every pixel around."""
    height, width = view.depth_m.shape
    widest = 0.5 * max(height, width) / view.focal + 0.5
    depth = np.maximum(points[2], np.float32(2.0 * reach_m))
    scale = np.float32(view.focal) / depth
    row = np.float32(view.center_row) - scale * points[1]
    column = np.float32(view.center_column) + scale * points[0]
    slant = np.float32(view.focal * reach_m * np.hypot(1.0, widest))
    radius_px = slant / (depth - np.float32(reach_m))
    may_touch = DepthBins(view, reach_m).may_touch(row, column, radius_px, depth)
    return np.asarray(may_touch | (points[2] < 2.0 * reach_m))
