"""The surface seen so far as a thinned point cloud, with the distance to it."""

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from torch import Tensor

LEAF_POINTS = 64
"""Points in a leaf of the search tree; large leaves suit queries that are many and far from the surface."""
RECENT_BITS = 18
"""Binary logarithm of the number of voxels that are remembered where they are found fastest."""
PAIRS_AT_ONCE = 1 << 26
"""Distances that are computed at once on an accelerator."""


class SurfaceCloud:
    """One observed point per voxel, and a search tree over them that is rebuilt as the cloud grows.

    Args:
        voxel_m: Spacing of the kept points, metres.
        rebuild_share: The tree is rebuilt when the cloud has grown by this share since.
    """

    def __init__(self, voxel_m: float = 0.05, rebuild_share: float = 0.02) -> None:
        self.voxel_m, self.rebuild_share = voxel_m, rebuild_share
        self._forget()

    def _forget(self) -> None:
        self._keys: NDArray[np.int64] = np.empty(0, np.int64)
        self._recent: NDArray[np.int64] = np.full(1 << RECENT_BITS, -1, np.int64)
        self._points: list[NDArray[np.float32]] = []
        self._count = 0
        self._tree: cKDTree | None = None
        self._device_points: Tensor | None = None

    def __len__(self) -> int:
        return self._count

    @property
    def points(self) -> NDArray[np.float32]:
        """(N, 3) float32 kept points, metres, world frame."""
        if len(self._points) > 1:
            self._points = [np.concatenate(self._points)]
        return self._points[0] if self._points else np.empty((0, 3), np.float32)

    def add(self, points: NDArray[np.float32]) -> int:
        """Keep the first point of each voxel that was empty.

        Args:
            points: (N, 3) float32, metres, world frame.

        Returns:
            How many points were kept.
        """
        all_keys = _keys_of(points, self.voxel_m)
        unsure = np.flatnonzero(self._recent[_slots_of(all_keys)] != all_keys)
        keys, first = np.unique(all_keys[unsure], return_index=True)
        self._recent[_slots_of(keys)] = keys
        position = np.searchsorted(self._keys, keys)
        known = np.zeros(len(keys), bool)
        inside = position < len(self._keys)
        known[inside] = self._keys[position[inside]] == keys[inside]
        if known.all():
            return 0
        self._keys = np.insert(self._keys, position[~known], keys[~known])
        self._points.append(points[unsure[first[~known]]])
        self._count = len(self._keys)
        return int((~known).sum())

    def distance_of(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Distance of (N, 3) points to the nearest kept point, (N,) float32 metres.

        The tree is rebuilt when the cloud has grown by 2 %, so on a CPU the newest points may be missing.
        """
        nearest, _ = self._current_tree().query(points)
        return np.asarray(nearest, np.float32)

    def is_near(self, points: NDArray[np.floating], radius_m: float) -> NDArray[np.bool_]:
        """Tell which of (N, 3) points have a kept point within a radius, (N,) bool; faster than distances."""
        nearest, _ = self._current_tree().query(points, distance_upper_bound=np.nextafter(radius_m, np.inf))
        return np.asarray(np.isfinite(nearest))

    def distance(self, points: Tensor) -> Tensor:
        """Like `distance_of`, for and as tensors on any device; on an accelerator nothing leaves it."""
        if points.device.type == "cpu":
            return torch.from_numpy(self.distance_of(points.detach().numpy()))
        return _nearest_distance(points.detach(), self._points_on(points.device))

    def restore(self, points: NDArray[np.float32]) -> None:
        """Replace the cloud by saved (N, 3) points."""
        self._forget()
        if len(points):
            self._points, self._keys = [points], np.sort(_keys_of(points, self.voxel_m))
            self._count = len(points)

    def bounds(self, quantile: float = 0.0) -> NDArray[np.float64]:
        """(2, 3) corners of the cloud, metres; a quantile leaves out stray points on each side."""
        return np.asarray(np.quantile(self.points, [quantile, 1.0 - quantile], axis=0), np.float64)

    def _current_tree(self) -> cKDTree:
        if self._tree is None or self._count > (1.0 + self.rebuild_share) * self._tree.n:
            self._tree = cKDTree(self.points, leafsize=LEAF_POINTS, balanced_tree=False, compact_nodes=False)
        return self._tree

    def _points_on(self, device: torch.device) -> Tensor:
        """A copy of the points on a device, (N, 3) float32; only the new ones are sent."""
        sent = self._device_points
        if sent is None or sent.device != device:
            sent = torch.empty((0, 3), device=device)
        if len(sent) < self._count:
            sent = torch.cat([sent, torch.from_numpy(self.points[len(sent) :]).to(device)])
        self._device_points = sent
        return sent


def _nearest_distance(points: Tensor, cloud: Tensor) -> Tensor:
    """Distance of (N, 3) points to the nearest of (M, 3), (N,), from all pairs; infinite if there is none."""
    if len(cloud) == 0:
        return torch.full_like(points[:, 0], torch.inf)
    # Products of matrices would lose the distances of points that are close.
    mode = "donot_use_mm_for_euclid_dist"
    chunks = points.split(max(1, PAIRS_AT_ONCE // len(cloud)))
    return torch.cat([torch.cdist(chunk, cloud, compute_mode=mode).amin(dim=1) for chunk in chunks])


def _keys_of(points: NDArray[np.float32], voxel_m: float) -> NDArray[np.int64]:
    """One number, (N,) and not negative, for the voxel of each point."""
    x, y, z = (np.floor(points[:, axis] / voxel_m).astype(np.int64) + (1 << 20) for axis in range(3))
    return np.asarray((x << 42) | (y << 21) | z)


def _slots_of(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """Scatter keys over the slots in which the latest are remembered (Fibonacci hashing)."""
    mixed = keys.view(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    return (mixed >> np.uint64(64 - RECENT_BITS)).astype(np.int64)
