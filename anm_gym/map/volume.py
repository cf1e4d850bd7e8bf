"""A coarse log of the space that rays have passed, hit, or never reached."""

import numpy as np
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec

UNKNOWN, FREE, OCCUPIED = 0, 1, 2


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
        ray_index, step_index = np.nonzero(self._steps[None, :] < (reach - 1.5 * self.voxel_m)[:, None])
        passed = center + rays[ray_index] * self._steps[step_index, None]
        near = depth <= self.max_range_m
        hits = center + rays[near] * depth[near, None]
        self._cover(np.concatenate([center + rays * reach[:, None], center[None]]))
        free = self._flat_indices(passed)
        flat = self.states.reshape(-1)
        flat[free] = np.maximum(flat[free], FREE)
        flat[self._flat_indices(hits)] = OCCUPIED

    def state_at(self, points: NDArray[np.floating]) -> NDArray[np.uint8]:
        """State of the voxel of each of (..., 3) points; UNKNOWN outside the log."""
        scaled = points * np.float32(1.0 / self.voxel_m)
        index = np.floor(scaled).astype(np.int32) - self.low_index.astype(np.int32)
        shape = np.array(self.states.shape)
        inside = ((index >= 0) & (index < shape)).all(axis=-1)
        index = np.where(inside[..., None], index, 0)
        states = self.states[index[..., 0], index[..., 1], index[..., 2]] if self.states.size else 0
        return np.where(inside, states, UNKNOWN).astype(np.uint8)

    def _flat_indices(self, points: NDArray[np.float32]) -> NDArray[np.int64]:
        index = np.floor(points * np.float32(1.0 / self.voxel_m)).astype(np.int64) - self.low_index
        _, height, depth = self.states.shape
        return np.asarray((index[:, 0] * height + index[:, 1]) * depth + index[:, 2])

    def _cover(self, points: NDArray[np.float32]) -> None:
        """Grow the log so that it holds the convex hull of the points."""
        low = np.floor(points.min(axis=0) / self.voxel_m).astype(np.int64) - 1
        high = np.floor(points.max(axis=0) / self.voxel_m).astype(np.int64) + 2
        old_low, old_high = self.low_index, self.low_index + self.states.shape
        if self.states.size and (low >= old_low).all() and (high <= old_high).all():
            return
        slack = 10
        if self.states.size:
            low = np.where(low < old_low, low - slack, old_low)
            high = np.where(high > old_high, high + slack, old_high)
        grown = np.zeros(tuple(high - low), np.uint8)
        if self.states.size:
            start = old_low - low
            stop = start + self.states.shape
            grown[start[0] : stop[0], start[1] : stop[1], start[2] : stop[2]] = self.states
        self.states, self.low_index = grown, low
