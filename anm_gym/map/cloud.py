"""The surface seen so far as a thinned point cloud, with the distance to it."""

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from torch import Tensor


class SurfaceCloud:
    """One observed point per voxel, and a search tree over them that is rebuilt as the cloud grows.

    Args:
        voxel_m: Spacing of the kept points, metres.
        rebuild_share: The tree is rebuilt when the cloud has grown by this share since.
    """

    def __init__(self, voxel_m: float = 0.05, rebuild_share: float = 0.02) -> None:
        self.voxel_m, self.rebuild_share = voxel_m, rebuild_share
        self._keys: NDArray[np.int64] = np.empty(0, np.int64)
        self._points: list[NDArray[np.float32]] = []
        self._count = 0
        self._tree: cKDTree | None = None

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
        cells = np.floor(points / self.voxel_m).astype(np.int64) + (1 << 20)
        keys, first = np.unique((cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2], return_index=True)
        position = np.searchsorted(self._keys, keys)
        known = np.zeros(len(keys), bool)
        inside = position < len(self._keys)
        known[inside] = self._keys[position[inside]] == keys[inside]
        if known.all():
            return 0
        self._keys = np.insert(self._keys, position[~known], keys[~known])
        self._points.append(points[first[~known]])
        self._count = len(self._keys)
        return int((~known).sum())

    def distance_of(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """Distance of (N, 3) points to the nearest kept point, (N,) float32 metres."""
        nearest, _ = self._current_tree().query(points)
        return np.asarray(nearest, np.float32)

    def distance(self, points: Tensor) -> Tensor:
        """Like `distance_of`, for and as tensors on any device."""
        return torch.from_numpy(self.distance_of(points.detach().cpu().numpy())).to(points.device)

    def restore(self, points: NDArray[np.float32]) -> None:
        """Replace the cloud by saved (N, 3) points."""
        self._keys, self._points, self._count, self._tree = np.empty(0, np.int64), [], 0, None
        if len(points):
            self.add(points)

    def bounds(self, quantile: float = 0.0) -> NDArray[np.float64]:
        """(2, 3) corners of the cloud, metres; a quantile leaves out stray points on each side."""
        return np.asarray(np.quantile(self.points, [quantile, 1.0 - quantile], axis=0), np.float64)

    def _current_tree(self) -> cKDTree:
        if self._tree is None or self._count > (1.0 + self.rebuild_share) * self._tree.n:
            self._tree = cKDTree(self.points, balanced_tree=False, compact_nodes=False)
        return self._tree
