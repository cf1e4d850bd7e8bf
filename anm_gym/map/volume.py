"""A coarse log of the space that rays have passed, hit, or never reached."""

import numpy as np
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec

UNKNOWN, EMPTY, FREE, OCCUPIED = 0, 1, 2, 3
"""States of a voxel, each stronger than those before; only rays that met nothing have passed an empty one."""
BLOCKED = 1 << 12
"""Price of an occupied sample: more than the samples of a ray, and a sixteenth of what 16 bits hold."""
STEPS_BETWEEN_CHECKS = 8
"""Samples after which the rays that are blocked are dropped."""
RAYS_AT_ONCE = 1 << 14
"""Rays that are traced side by side: their samples stay in the cache."""


class ObservedVolume:
    """Voxels marked empty or free by passing rays and occupied by hits; a hit is never erased.

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
        self._rays = camera.directions.reshape(-1, 3)[self._pixels].T.astype(np.float64)
        self._empty_range_m = min(max_range_m, camera.max_depth_m) if camera.min_depth_m == 0.0 else 0.0
        self._steps = np.arange(0.0, max_range_m, voxel_m, dtype=np.float32) + 0.5 * voxel_m
        self.low_index = np.zeros(3, np.int64)
        self.states: NDArray[np.uint8] = np.zeros((0, 0, 0), np.uint8)

    def integrate(self, depth_m: NDArray[np.float32], world_from_camera: NDArray[np.floating]) -> None:
        """Mark what one posed depth image shows.

        Args:
            depth_m: (H, W) or (H, W, 1) float32 planar depth, metres; 0 is empty. Nothing is there then as
                far as the camera sees, and what is imagined behind a missing ceiling need not be looked for
                again. A camera that also leaves out what is too near says nothing by an empty pixel.
            world_from_camera: (4, 4) pose.
        """
        depth, center = depth_m.reshape(-1)[self._pixels], world_from_camera[:3, 3:].astype(np.float32)
        rays = (world_from_camera[:3, :3] @ self._rays).astype(np.float32)
        is_hit = (depth > 0.0) & (depth <= self.max_range_m)
        farthest_m = np.where(depth > 0.0, self.max_range_m, self._empty_range_m).astype(np.float32)
        reach = np.where(is_hit, depth, farthest_m)
        ends = center + rays * reach
        self._cover(np.concatenate([ends, center], axis=1))
        num_steps = np.searchsorted(self._steps, reach - np.float32(1.5 * self.voxel_m))
        for state, chosen in ((FREE, depth > 0.0), (EMPTY, depth == 0.0)):
            self._pass(center, rays[:, chosen], num_steps[chosen], state)
        hits = self._index_of(ends[:, is_hit])
        self.states[hits[0], hits[1], hits[2]] = OCCUPIED

    def state_at(self, points: NDArray[np.floating]) -> NDArray[np.uint8]:
        """State of the voxel of each of (..., 3) points; UNKNOWN outside the log."""
        if self.states.size == 0:
            return np.full(points.shape[:-1], UNKNOWN, np.uint8)
        index = np.floor(points * np.float32(1.0 / self.voxel_m)).astype(np.int64) - self.low_index
        # What is outside falls on the border, which no ray ever reaches.
        x, y, z = np.moveaxis(np.clip(index, 0, np.array(self.states.shape) - 1), -1, 0)
        return np.asarray(self.states[x, y, z])

    def window(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Copy the states of a box of voxels, UNKNOWN outside the log.

        Args:
            low: (3,) lowest voxel; voxel i spans from ``i * voxel_m`` to ``(i + 1) * voxel_m``.
            high: (3,) one past the highest voxel.

        Returns:
            (X, Y, Z) uint8.
        """
        states = np.full(tuple(high - low), UNKNOWN, np.uint8)
        first = np.maximum(low, self.low_index)
        last = np.minimum(high, self.low_index + self.states.shape)
        if (first < last).all():
            known = self.states[_box(first - self.low_index, last - self.low_index)]
            states[_box(first - low, last - low)] = known
        return states

    def trace(
        self, origins: NDArray[np.float32], steps: NDArray[np.float32], num_samples: NDArray[np.integer]
    ) -> NDArray[np.int64]:
        """Look for obstacles and for unknown space along rays.

        Args:
            origins: (3, R) float32 first sample of each ray, metres, world frame; columns, as that is faster.
            steps: (3, R) float32 from one sample to the next, metres.
            num_samples: (R,) samples of each ray, less than `BLOCKED` and at least 1; the longest ray first.

        Returns:
            (R,) how many samples are UNKNOWN; -1 where one is OCCUPIED.
        """
        prices = np.zeros(len(num_samples), np.uint16)
        if len(prices):
            last = origins + steps * (num_samples - 1).astype(np.float32)
            low_m, high_m = np.minimum(origins, last).min(axis=1), np.maximum(origins, last).max(axis=1)
            box = _PricedBox(self, low_m, high_m)
            for first in range(0, len(prices), RAYS_AT_ONCE):
                part = np.s_[first : first + RAYS_AT_ONCE]
                # What hides a surface mostly stands right before it: seen from there, most rays end soon.
                prices[part] = box.price_along(last[:, part], -steps[:, part], num_samples[part])
        return np.where(prices < BLOCKED, prices.astype(np.int64), -1)

    def _pass(
        self, center: NDArray[np.float32], rays: NDArray[np.float32], num_steps: NDArray[np.int64], state: int
    ) -> None:
        """Mark what (3, R) rays from a (3, 1) centre pass, all at one step: that fits a cache."""
        order = np.argsort(-num_steps.astype(np.int16), kind="stable")
        num_alive = len(order) - np.cumsum(np.bincount(num_steps, minlength=1))
        per_m = np.float32(1.0 / self.voxel_m)
        rays, start = rays[:, order] * per_m, center * per_m - self.low_index[:, None].astype(np.float32)
        flat = self.states.reshape(-1)
        for step_m, alive in zip(self._steps, num_alive, strict=False):
            passed = _flat_index(start, rays[:, :alive], step_m, self.states.shape)
            flat[passed] = np.maximum(flat[passed], state)

    def _index_of(self, points: NDArray[np.float32]) -> NDArray[np.int64]:
        """Voxels (3, N) of (3, N) points inside the log."""
        index = np.floor(points * np.float32(1.0 / self.voxel_m)).astype(np.int64)
        return np.asarray(index - self.low_index[:, None])

    def _cover(self, points: NDArray[np.float32]) -> None:
        """Grow the log so that it holds the convex hull of (3, N) points and a border of one voxel."""
        low = np.floor(points.min(axis=1) / self.voxel_m).astype(np.int64) - 1
        high = np.floor(points.max(axis=1) / self.voxel_m).astype(np.int64) + 2
        old_low, old_high = self.low_index, self.low_index + self.states.shape
        if self.states.size and (low >= old_low).all() and (high <= old_high).all():
            return
        slack = 10
        if self.states.size:
            low = np.where(low < old_low, low - slack, old_low)
            high = np.where(high > old_high, high + slack, old_high)
        self.states, self.low_index = self.window(low, high), low


class _PricedBox:
    """The voxels of a box, each with a price: 1 if unknown, `BLOCKED` if occupied, 0 if free.

    Args:
        volume: What is known.
        low_m: (3,) lowest corner, metres.
        high_m: (3,) highest corner, metres.
    """

    def __init__(
        self, volume: ObservedVolume, low_m: NDArray[np.float32], high_m: NDArray[np.float32]
    ) -> None:
        self._per_m = np.float32(1.0 / volume.voxel_m)
        low = np.floor(low_m * self._per_m).astype(np.int64) - 1
        states = volume.window(low, np.floor(high_m * self._per_m).astype(np.int64) + 2)
        self._prices = (states == UNKNOWN) + np.uint16(BLOCKED) * (states == OCCUPIED)
        self._low = low.astype(np.float32)[:, None]

    def price_along(
        self, starts: NDArray[np.float32], steps: NDArray[np.float32], num_samples: NDArray[np.integer]
    ) -> NDArray[np.uint16]:
        """Add up the prices along (3, R) rays, the longest first; one ends soon after an occupied sample."""
        prices, shape = self._prices.reshape(-1), self._prices.shape
        sums = np.zeros(len(num_samples), np.uint16)
        totals, ray, ends = sums.copy(), np.arange(len(sums)), -num_samples
        lines = np.concatenate([starts * self._per_m - self._low, steps * self._per_m])
        for index in range(int(num_samples[0])):
            alive = int(np.searchsorted(ends, -index))
            flat = _flat_index(lines[:3, :alive], lines[3:, :alive], np.float32(index), shape)
            sums[:alive] += prices[flat]
            if index % STEPS_BETWEEN_CHECKS == STEPS_BETWEEN_CHECKS - 1:
                totals[ray] = sums
                kept = np.flatnonzero(sums[:alive] < BLOCKED)
                ray, sums, ends, lines = ray[kept], sums[kept], ends[kept], lines[:, kept]
        totals[ray] = sums
        return totals


def _flat_index(
    start: NDArray[np.float32], step: NDArray[np.float32], factor: np.float32, shape: tuple[int, ...]
) -> NDArray[np.int32]:
    """Flat index, (R,), of the voxels at ``start + factor * step``, (3, R), in voxels from the lowest one."""
    # Truncation is the floor here, as nothing lies under the lowest voxel.
    flat: NDArray[np.int32] = (step[0] * factor + start[0]).astype(np.int32)
    flat *= shape[1]
    flat += (step[1] * factor + start[1]).astype(np.int32)
    flat *= shape[2]
    flat += (step[2] * factor + start[2]).astype(np.int32)
    return flat


def _box(low: NDArray[np.int64], high: NDArray[np.int64]) -> tuple[slice, ...]:
    """Slices from one corner to before another."""
    return tuple(slice(int(first), int(last)) for first, last in zip(low, high, strict=True))
