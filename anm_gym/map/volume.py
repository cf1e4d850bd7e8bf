"""A coarse log of the space that rays have passed, hit, or never reached."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec

UNKNOWN, FREE, OCCUPIED = 0, 1, 2
BLOCKED = 1 << 12
"""Price of an occupied sample, more than the number of samples of a ray."""
STEPS_BETWEEN_CHECKS = 8
"""Rays are dropped that often once they are blocked; so many prices of `BLOCKED` fit 16 bits."""
RAYS_AT_ONCE = 1 << 14
"""Rays traced side by side, so that they stay in the cache."""


class ObservedVolume:
    """Voxels marked free by passing rays and occupied by hits; a hit is never erased.

    Args:
        camera: The camera of every frame.
        voxel_m: Edge of a voxel, metres.
        max_range_m: Planar depth to which rays are followed, metres.
        image_px: Side of the square grid of rays per frame.
    """

    def __init__(
        self, camera: CameraSpec, *, voxel_m: float = 0.1, max_range_m: float = 8.0, image_px: int = 96
    ) -> None:
        self.camera, self.voxel_m, self.max_range_m = camera, voxel_m, max_range_m
        rows = np.linspace(0, camera.height_px - 1, min(image_px, camera.height_px)).round().astype(int)
        columns = np.linspace(0, camera.width_px - 1, min(image_px, camera.width_px)).round().astype(int)
        self._pixels = (rows[:, None] * camera.width_px + columns).ravel()
        self._rays = camera.directions.reshape(-1, 3)[self._pixels]
        self._steps = np.arange(0.0, max_range_m, voxel_m, dtype=np.float32) + 0.5 * voxel_m
        self.low_index = np.zeros(3, np.int64)
        self.states: NDArray[np.uint8] = np.zeros((0, 0, 0), np.uint8)

    def integrate(self, depth_m: NDArray[np.float32], world_from_camera: NDArray[np.floating]) -> None:
        """Mark what one posed depth image shows.

        Args:
            depth_m: (H, W) or (H, W, 1) float32 planar depth, metres; 0 is empty and says nothing.
            world_from_camera: (4, 4) pose.
        """
        depth = depth_m.reshape(-1)[self._pixels]
        seen = depth > 0.0
        rays = (self._rays[seen] @ world_from_camera[:3, :3].T).astype(np.float32)
        depth, center = depth[seen], world_from_camera[:3, 3].astype(np.float32)
        reach = np.minimum(depth, self.max_range_m)
        near = depth <= self.max_range_m
        hits = center + rays[near] * depth[near, None]
        self._cover(np.concatenate([center + rays * reach[:, None], center[None]]))
        self._free(center, rays, np.searchsorted(self._steps, reach - 1.5 * self.voxel_m))
        self.states.reshape(-1)[self._flat_indices(hits)] = OCCUPIED

    def state_at(self, points: NDArray[np.floating]) -> NDArray[np.uint8]:
        """State of the voxel of each of (..., 3) points; UNKNOWN outside the log."""
        if self.states.size == 0:
            return np.full(points.shape[:-1], UNKNOWN, np.uint8)
        x, y, z = (self._clipped_index(points[..., axis], axis) for axis in range(3))
        return self.states[x, y, z]

    def state_on_grid(self, axes_m: Sequence[NDArray[np.floating]]) -> NDArray[np.uint8]:
        """Like `state_at`, for the (X, Y, Z) points of a grid, given by their coordinates along each axis."""
        if self.states.size == 0:
            return np.full([len(values) for values in axes_m], UNKNOWN, np.uint8)
        return self.states[np.ix_(*(self._clipped_index(values, axis) for axis, values in enumerate(axes_m)))]

    def window(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Copy the states of a box of voxels, UNKNOWN outside the log.

        Args:
            low: (3,) lowest voxel; voxel i spans from ``i * voxel_m`` to ``(i + 1) * voxel_m``.
            high: (3,) one past the highest voxel, everywhere more than `low`.

        Returns:
            (X, Y, Z) uint8.
        """
        states = np.full(tuple(high - low), UNKNOWN, np.uint8)
        first = np.maximum(low, self.low_index)
        last = np.minimum(high, self.low_index + self.states.shape)
        if (first < last).all():
            states[_box(first - low, last - low)] = self.states[
                _box(first - self.low_index, last - self.low_index)
            ]
        return states

    def trace(
        self, origins: NDArray[np.float32], steps: NDArray[np.float32], num_samples: NDArray[np.integer]
    ) -> NDArray[np.int64]:
        """Look for obstacles and for unknown space along rays.

        Args:
            origins: (R, 3) float32 first sample of each ray, metres, world frame.
            steps: (R, 3) float32 from one sample to the next, metres.
            num_samples: (R,) samples of each ray, between 1 and 4095.

        Returns:
            (R,) how many samples are UNKNOWN; -1 where one is OCCUPIED.
        """
        costs = np.zeros(len(origins), np.int64)
        if len(origins) == 0:
            return costs
        order = np.argsort(-num_samples, kind="stable")
        tracer = _Tracer(self, origins, origins + steps * num_samples[:, None].astype(np.float32))
        for part in np.array_split(order, -(-len(order) // RAYS_AT_ONCE)):
            costs[part] = tracer.costs(origins[part], steps[part], num_samples[part])
        return np.where(costs < BLOCKED, costs, -1)

    def _free(
        self, center: NDArray[np.float32], rays: NDArray[np.float32], num_steps: NDArray[np.int64]
    ) -> None:
        """Mark what each ray passes in its number of steps, one step of all rays at a time."""
        order = np.argsort(-num_steps, kind="stable")
        alive = len(rays) - np.cumsum(np.bincount(num_steps, minlength=1))
        per_m = np.float32(1.0 / self.voxel_m)
        x, y, z = (rays[order] * per_m).T.copy()
        start = center * per_m - self.low_index.astype(np.float32)
        _, height, depth = self.states.shape
        flat = self.states.reshape(-1)
        for step_m, count in zip(self._steps, alive, strict=False):
            # Truncation is the floor here, as no ray leaves the log.
            index = (x[:count] * step_m + start[0]).astype(np.int32) * np.int32(height)
            index += (y[:count] * step_m + start[1]).astype(np.int32)
            index *= np.int32(depth)
            index += (z[:count] * step_m + start[2]).astype(np.int32)
            flat[index] = np.maximum(flat[index], FREE)

    def _clipped_index(self, values_m: NDArray[np.floating], axis: int) -> NDArray[np.int64]:
        """Index along an axis; what is outside falls on the border, which no ray ever reaches."""
        index = np.floor(values_m * np.float32(1.0 / self.voxel_m)).astype(np.int64) - self.low_index[axis]
        return np.asarray(np.clip(index, 0, self.states.shape[axis] - 1))

    def _flat_indices(self, points: NDArray[np.float32]) -> NDArray[np.int64]:
        index = np.floor(points * np.float32(1.0 / self.voxel_m)).astype(np.int64) - self.low_index
        _, height, depth = self.states.shape
        return np.asarray((index[:, 0] * height + index[:, 1]) * depth + index[:, 2])

    def _cover(self, points: NDArray[np.float32]) -> None:
        """Grow the log so that it holds the convex hull of the points, and a border of one voxel."""
        low = np.floor(points.min(axis=0) / self.voxel_m).astype(np.int64) - 1
        high = np.floor(points.max(axis=0) / self.voxel_m).astype(np.int64) + 2
        old_low, old_high = self.low_index, self.low_index + self.states.shape
        if self.states.size and (low >= old_low).all() and (high <= old_high).all():
            return
        slack = 10
        if self.states.size:
            low = np.where(low < old_low, low - slack, old_low)
            high = np.where(high > old_high, high + slack, old_high)
        self.states, self.low_index = self.window(low, high), low


def _box(low: NDArray[np.int64], high: NDArray[np.int64]) -> tuple[slice, ...]:
    """Slices from one corner to before another."""
    return tuple(slice(int(first), int(last)) for first, last in zip(low, high, strict=True))


class _Tracer:
    """Adds up samples along rays in a box of voxels: 1 for an unknown one, `BLOCKED` for an occupied one.

    Args:
        volume: What is known.
        starts: (R, 3) float32 one end of each ray, metres.
        ends: (R, 3) float32 the other.
    """

    def __init__(
        self, volume: ObservedVolume, starts: NDArray[np.float32], ends: NDArray[np.float32]
    ) -> None:
        self._per_m = np.float32(1.0 / volume.voxel_m)
        low = np.floor(np.minimum(starts.min(axis=0), ends.min(axis=0)) * self._per_m).astype(np.int64) - 1
        high = np.floor(np.maximum(starts.max(axis=0), ends.max(axis=0)) * self._per_m).astype(np.int64) + 2
        prices = np.zeros(3, np.uint16)
        prices[UNKNOWN], prices[OCCUPIED] = 1, BLOCKED
        self._prices = prices[volume.window(low, high)].ravel()
        self._low = low.astype(np.float32)
        self._height, self._depth = (high - low).astype(np.int32)[1:]

    def costs(
        self, origins: NDArray[np.float32], steps: NDArray[np.float32], num_samples: NDArray[np.integer]
    ) -> NDArray[np.uint16]:
        """Sum along rays, (R,), which come longest first; a ray ends soon after an occupied sample.

        The last sample is the first to be looked at: what hides a surface is mostly right before it.
        """
        totals = np.zeros(len(origins), np.uint16)
        ray, costs, ends = np.arange(len(origins)), totals.copy(), -num_samples
        step = (-steps * self._per_m).T
        first = (origins * self._per_m - self._low).T - step * (num_samples - 1).astype(np.float32)
        lines = np.concatenate([first, step])
        for index in range(int(num_samples[0])):
            alive = int(np.searchsorted(ends, -index))
            costs[:alive] += self._prices[self._flat_indices(lines[:, :alive], np.float32(index))]
            if index % STEPS_BETWEEN_CHECKS == STEPS_BETWEEN_CHECKS - 1:
                totals[ray] = costs
                open_rays = np.flatnonzero(costs[:alive] < BLOCKED)
                ray, costs, ends, lines = (
                    ray[open_rays],
                    costs[open_rays],
                    ends[open_rays],
                    lines[:, open_rays],
                )
        totals[ray] = costs
        return totals

    def _flat_indices(self, lines: NDArray[np.float32], index: np.float32) -> NDArray[np.int32]:
        """Voxels of the samples with an index; truncation is the floor here, as no ray leaves the box."""
        flat: NDArray[np.int32] = (lines[3] * index + lines[0]).astype(np.int32) * self._height
        flat += (lines[4] * index + lines[1]).astype(np.int32)
        flat *= self._depth
        flat += (lines[5] * index + lines[2]).astype(np.int32)
        return flat
