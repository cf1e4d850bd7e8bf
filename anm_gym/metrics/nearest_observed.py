"""How near to each surface sample a depth pixel has ever fallen: exact below a threshold, frame by frame.

A nearest-neighbour tree over each frame's points would cost more than the robot's whole step. The frame
is a grid, so the pixels that can lie within a distance of a sample form a small window around its
projection; the window shrinks with the best distance known, and most samples then have no pixel in it.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from anm_gym.metrics.depth_patches import PATCH_PX, DepthPatches
from anm_gym.metrics.depth_view import DepthView
from anm_gym.metrics.sample_blocks import InView, SampleBlocks

_PAIRS_PER_CHUNK = 500_000
_ROUNDING_PX = np.float32(1e-3)


class NearestObserved:
    """Running distance from surface samples to the nearest observed point, exact up to `reach_m`.

    Exact up to the float32 rounding of camera coordinates, a few micrometres in a home.
    """

    def __init__(self, blocks: SampleBlocks, reach_m: float) -> None:
        """Start with nothing observed.

        Args:
            blocks: The samples.
            reach_m: Distances from here on are reported as infinite, metres.

        Raises:
            ValueError: If `reach_m` is not positive.
        """
        if not reach_m > 0.0:
            raise ValueError(f"`reach_m` must be > 0, got {reach_m}")
        self.reach_m = reach_m
        self._blocks = blocks
        self._reach = np.float32(reach_m)
        self._best = np.full(len(blocks), self._reach, np.float32)

    @property
    def num_covered(self) -> int:
        """Number of samples with an observed point nearer than `reach_m`."""
        return int(np.count_nonzero(self._best < self._reach))

    @property
    def covered(self) -> NDArray[np.bool_]:
        """(N,) bool: an observed point lies nearer than `reach_m`."""
        return self._blocks.in_given_order(self._best < self._reach)

    @property
    def distance_m(self) -> NDArray[np.float32]:
        """(N,) float32 distance to the nearest observed point, metres; infinite from `reach_m` on."""
        best = np.where(self._best < self._reach, self._best, np.float32(np.inf))
        return self._blocks.in_given_order(best)

    def covered_among(self, found: InView) -> InView:
        """Those of some samples that are covered by now."""
        kept = np.flatnonzero(self._best[found.index] < self._reach)
        return InView(found.index[kept], found.camera_points[:, kept])

    def observe(self, view: DepthView, in_view: InView | None = None) -> None:
        """Account for the points of one more frame.

        Args:
            view: The frame; its empty pixels observe nothing.
            in_view: What `SampleBlocks.in_view` found for this frame, or for one that holds its pixels.
        """
        if not view.is_valid.any():
            return
        found = in_view or self._blocks.in_view(view, self.reach_m)
        is_close = found.camera_points[2] < 2.0 * self._reach
        if is_close.any():
            self._observe_close(view, found.index[is_close], found.camera_points[:, is_close])
        far = np.flatnonzero(~is_close)
        queries = _Queries.project(view, found.index[far], found.camera_points[:, far])
        self._improve_windows(view, self._improve_centers(view, queries))

    def _improve_centers(self, view: DepthView, queries: "_Queries") -> "_Queries":
        """Try the pixel nearest to each projection; hand back the samples that have one within reach."""
        windows = queries.windows(self._best[queries.index], view)
        some = np.flatnonzero(windows.num_pixels > 0)
        queries, windows = queries.take(some), windows.take(some)
        rows = np.clip(np.rint(queries.row).astype(np.int32), windows.row_low, windows.row_high)
        columns = np.clip(np.rint(queries.column).astype(np.int32), windows.column_low, windows.column_high)
        distance = queries.distance_to(view, rows, columns)
        self._best[queries.index] = np.minimum(self._best[queries.index], distance)
        return queries

    def _improve_windows(self, view: DepthView, queries: "_Queries") -> None:
        """Try the pixels of the windows that hold more than the one tried."""
        windows = queries.windows(self._best[queries.index], view)
        many = np.flatnonzero(windows.num_pixels > 1)
        queries, windows, patches = queries.take(many), windows.take(many), DepthPatches(view)
        for some in _chunks(windows.patched().num_pixels):
            found = self._narrowed(patches, queries.take(some), windows.take(some))
            for part in _chunks(found[1].num_pixels):
                self._improve_pairs(view, found[0].take(part), found[1].take(part))

    def _narrowed(
        self, patches: DepthPatches, queries: "_Queries", windows: "_Windows"
    ) -> tuple["_Queries", "_Windows"]:
        """Cut windows into patches, each with the sample again, and leave out those out of reach."""
        sample, row, column = windows.patched().pairs()
        queries = queries.take(sample)
        points = np.stack([queries.x, queries.y, queries.depth])
        reached = patches.in_reach(row * patches.columns + column, points, self._best[queries.index])
        kept = np.flatnonzero(reached)
        return queries.take(kept), windows.take(sample[kept]).within(row[kept], column[kept])

    def _improve_pairs(self, view: DepthView, queries: "_Queries", windows: "_Windows") -> None:
        sample, rows, columns = windows.pairs()
        distance = queries.take(sample).distance_to(view, rows, columns)
        starts = np.cumsum(windows.num_pixels) - windows.num_pixels
        np.minimum.at(self._best, queries.index, np.minimum.reduceat(distance, starts))

    def _observe_close(
        self, view: DepthView, index: NDArray[np.int64], camera_points: NDArray[np.float32]
    ) -> None:
        """Search samples beside the lens, whose window would be the whole image, by a tree."""
        near = view.is_valid & (view.depth_m <= 3.0 * self._reach)
        if not near.any():
            return
        points = view.directions[near] * view.depth_m[near][:, None]
        samples = camera_points.T * np.array([1.0, 1.0, -1.0], np.float32)
        distance, _ = cKDTree(points).query(samples, distance_upper_bound=self.reach_m)
        self._best[index] = np.minimum(self._best[index], distance.astype(np.float32))


def _chunks(counts: NDArray[np.int32]) -> Iterator[slice]:
    """Cut a list of windows into parts of about `_PAIRS_PER_CHUNK` pixels or patches."""
    ends, start = np.cumsum(counts), 0
    while start < len(ends):
        done = ends[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(ends, done + _PAIRS_PER_CHUNK, side="right")))
        yield slice(start, stop)
        start = stop


@dataclass(frozen=True, eq=False)
class _Queries:
    """Samples in view and where they project."""

    index: NDArray[np.int64]
    x: NDArray[np.float32]
    y: NDArray[np.float32]
    depth: NDArray[np.float32]
    row: NDArray[np.float32]
    column: NDArray[np.float32]

    @classmethod
    def project(
        cls, view: DepthView, index: NDArray[np.int64], camera_points: NDArray[np.float32]
    ) -> "_Queries":
        x, y, depth = camera_points
        scale = np.float32(view.focal) / depth
        row = np.float32(view.center_row) - scale * y
        column = np.float32(view.center_column) + scale * x
        return cls(index, x, y, depth, row, column)

    def take(self, which: NDArray[np.int64] | slice) -> "_Queries":
        place, x, y = self.index[which], self.x[which], self.y[which]
        return _Queries(place, x, y, self.depth[which], self.row[which], self.column[which])

    def windows(self, radius_m: NDArray[np.float32], view: DepthView) -> "_Windows":
        """Bound the pixels whose points can lie within `radius_m` of each sample.

        A shift (dx, dz) of length r moves x / depth by at most
        ``r * hypot(1, x / depth) / (depth - r)``; the same holds for y.
        """
        scale = np.float32(view.focal) * radius_m / (self.depth - radius_m)
        across = scale * np.hypot(1.0, self.x / self.depth) + _ROUNDING_PX
        down = scale * np.hypot(1.0, self.y / self.depth) + _ROUNDING_PX
        height, width = view.depth_m.shape
        return _Windows(
            np.maximum(np.ceil(self.row - down), 0).astype(np.int32),
            np.minimum(np.floor(self.row + down), height - 1).astype(np.int32),
            np.maximum(np.ceil(self.column - across), 0).astype(np.int32),
            np.minimum(np.floor(self.column + across), width - 1).astype(np.int32),
        )

    def distance_to(
        self, view: DepthView, rows: NDArray[np.int32], columns: NDArray[np.int32]
    ) -> NDArray[np.float32]:
        """Distance to the point of one pixel each, metres; infinite where the pixel is empty."""
        depth = view.depth_m[rows, columns]
        per_pixel = depth / np.float32(view.focal)
        dx = (columns - np.float32(view.center_column)) * per_pixel - self.x
        dy = (np.float32(view.center_row) - rows) * per_pixel - self.y
        dz = depth - self.depth
        distance = np.sqrt(dx * dx + dy * dy + dz * dz)
        return np.asarray(np.where(depth > 0.0, distance, np.float32(np.inf)), np.float32)


@dataclass(frozen=True, eq=False)
class _Windows:
    """Inclusive pixel rectangles, clipped to the image."""

    row_low: NDArray[np.int32]
    row_high: NDArray[np.int32]
    column_low: NDArray[np.int32]
    column_high: NDArray[np.int32]

    @property
    def num_pixels(self) -> NDArray[np.int32]:
        rows = np.maximum(self.row_high - self.row_low + 1, 0)
        columns = np.maximum(self.column_high - self.column_low + 1, 0)
        return np.asarray(rows * columns, np.int32)

    def take(self, which: NDArray[np.int64] | slice) -> "_Windows":
        columns = (self.row_low, self.row_high, self.column_low, self.column_high)
        return _Windows(*(array[which] for array in columns))

    def patched(self) -> "_Windows":
        """The patches that the windows touch, instead of their pixels."""
        sides = (self.row_low, self.row_high, self.column_low, self.column_high)
        return _Windows(*(side // PATCH_PX for side in sides))

    def within(self, row: NDArray[np.int32], column: NDArray[np.int32]) -> "_Windows":
        """What lies in one patch of each window."""
        return _Windows(
            np.maximum(self.row_low, PATCH_PX * row),
            np.minimum(self.row_high, PATCH_PX * row + PATCH_PX - 1),
            np.maximum(self.column_low, PATCH_PX * column),
            np.minimum(self.column_high, PATCH_PX * column + PATCH_PX - 1),
        )

    def pairs(self) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.int32]]:
        """List (window, row, column) of every pixel, window by window."""
        counts = self.num_pixels
        window = np.repeat(np.arange(len(counts)), counts)
        ends = np.cumsum(counts)
        inside = np.arange(len(window), dtype=np.int32) - (ends - counts).astype(np.int32)[window]
        row, column = np.divmod(inside, (self.column_high - self.column_low + 1)[window])
        return window, row + self.row_low[window], column + self.column_low[window]
