"""The union of all observed points, thinned to one point per voxel: far distances need no more than that."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

_MARGIN_M = 0.5


class ObservedCloud:
    """Observed points inside a box, one (the first) per voxel.

    A distance to this cloud is never below the distance to all observed points, and above that to those
    within half a metre of the box by at most `bound_m`, the diagonal of a voxel. Of points farther outside,
    seen through windows, one is kept for each voxel of the border.
    """

    def __init__(
        self, bounds: NDArray[np.floating], voxel_m: float = 0.02, max_voxels: int = 40_000_000
    ) -> None:
        """Start empty.

        Args:
            bounds: (2, 3) lowest and highest corner of the surface, metres. Points more than half a
                metre outside it share the voxels of its border.
            voxel_m: Side of a voxel, metres; larger where the box would need more than `max_voxels`.
            max_voxels: Limit of memory, one byte each.
        """
        self._low = np.asarray(bounds[0], np.float32) - np.float32(_MARGIN_M)
        extent = np.asarray(bounds[1] - bounds[0], np.float64) + 2.0 * _MARGIN_M
        self.voxel_m = float(max(voxel_m, np.cbrt(extent.prod() / max_voxels)))
        self._shape = np.ceil(extent / self.voxel_m).astype(np.int32)
        self._is_taken = np.zeros(int(self._shape.astype(np.int64).prod()), bool)
        self._parts: list[NDArray[np.float32]] = []

    @property
    def bound_m(self) -> float:
        """Largest error of `distance_m` if no nearest point lies half a metre outside of the box, metres."""
        return float(np.sqrt(3.0) * self.voxel_m)

    @property
    def points(self) -> NDArray[np.float32]:
        """(M, 3) float32 kept points, in the order of their arrival, metres."""
        return np.concatenate(self._parts) if self._parts else np.zeros((0, 3), np.float32)

    def add(self, points: NDArray[np.float32]) -> None:
        """Keep the first point of every voxel that had none.

        Args:
            points: (N, 3) float32 observed points, metres, world frame.
        """
        scale = np.float32(1.0 / self.voxel_m)
        x, y, z = (
            np.clip(((points[:, axis] - self._low[axis]) * scale).astype(np.int32), 0, self._shape[axis] - 1)
            for axis in range(3)
        )
        voxels = (x * self._shape[1] + y) * self._shape[2] + z
        fresh = np.flatnonzero(~self._is_taken[voxels])
        if len(fresh) == 0:
            return
        kept_voxels, first = np.unique(voxels[fresh], return_index=True)
        self._is_taken[kept_voxels] = True
        self._parts.append(points[fresh[first]])

    def distance_m(self, queries: NDArray[np.floating], cap_m: float = np.inf) -> NDArray[np.float64]:
        """Distance to the nearest kept point.

        Args:
            queries: (N, 3), metres, world frame.
            cap_m: Distances beyond this are reported as this.

        Returns:
            (N,) float64 metres; `cap_m` everywhere while nothing was added.
        """
        points = self.points
        if len(points) == 0 or len(queries) == 0:
            return np.full(len(queries), cap_m)
        tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
        distance, _ = tree.query(queries, distance_upper_bound=cap_m)
        return np.asarray(np.minimum(distance, cap_m), np.float64)
