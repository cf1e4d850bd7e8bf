"""A raster laid on the floor: conversions between world points and cells."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.checks import check_positive


@dataclass(frozen=True)
class GridFrame:
    """Where the cells of a floor raster lie; rows run along +z, columns along +x."""

    origin_xz: tuple[float, float]
    """Lower corner of cell [0, 0], metres, world frame."""
    cell_m: float
    """Edge of a cell, metres."""
    shape: tuple[int, int]
    """Rows and columns."""

    def __post_init__(self) -> None:
        check_positive(self, "cell_m")
        if min(self.shape) < 1:
            raise ValueError(f"`shape` must have at least one row and one column, got {self.shape}")

    @classmethod
    def around(
        cls, low_xz: ArrayLike, high_xz: ArrayLike, cell_m: float, margin_m: float = 0.5
    ) -> "GridFrame":
        """Cover the rectangle between two (x, z) corners and a margin."""
        low = np.asarray(low_xz, np.float64) - margin_m
        extent = np.asarray(high_xz, np.float64) + margin_m - low
        columns, rows = np.maximum(np.ceil(extent / cell_m).astype(int), 1)
        return cls((float(low[0]), float(low[1])), cell_m, (int(rows), int(columns)))

    def cells_of(self, points_xz: ArrayLike) -> NDArray[np.int64]:
        """Cells [row, column] of (N, 2) points (x, z), (N, 2) int64; they may lie outside the raster."""
        points = np.atleast_2d(np.asarray(points_xz, np.float64))
        return np.floor((points - self.origin_xz) / self.cell_m).astype(np.int64)[:, ::-1]

    def centers_of(self, cells: ArrayLike) -> NDArray[np.float64]:
        """World (x, z) centres of (N, 2) cells, (N, 2) float64 metres."""
        index = np.atleast_2d(np.asarray(cells))
        return (index[:, ::-1] + 0.5) * self.cell_m + self.origin_xz

    def contains(self, cells: ArrayLike) -> NDArray[np.bool_]:
        """Tell which of (N, 2) cells lie inside the raster."""
        index = np.atleast_2d(np.asarray(cells))
        return np.asarray(((index >= 0) & (index < self.shape)).all(axis=1))
