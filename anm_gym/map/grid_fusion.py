"""Rasters registered in the world that fuse what is seen or predicted frame by frame.

These are the maps of learned grid baselines: probabilities in a raster of fixed size around the start,
with squares cut out around the agent and turned to its heading for a network, and its output put back.
"""

from dataclasses import dataclass
from typing import Final, final

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.geometry import heading_of
from anm_gym.sim.grid import GridFrame

KEEP_SHARE: Final = 0.9
"""Weight of what a known cell of a `RunningAverageGrid` holds (OccAnt)."""
MIN_EXPLORED: Final = 0.6
"""Probability of being explored above which a cell is written (OccAnt)."""
_CHANNELS_AT_ONCE = 4

Window = tuple[slice, slice]
"""Rows and columns of a raster."""


@dataclass(frozen=True)
class FloorPose:
    """Where an agent stands and looks."""

    position_xz: tuple[float, float]
    """Floor point, metres, world frame."""
    heading_rad: float
    """Heading, radians."""

    @classmethod
    def of(cls, world_from_camera: NDArray[np.floating]) -> "FloorPose":
        """Drop the pose (4, 4) of a level camera on the floor."""
        x, z = world_from_camera[[0, 2], 3]
        return cls((float(x), float(z)), heading_of(world_from_camera))

    @property
    def world_from_ego(self) -> NDArray[np.float64]:
        """(2, 3) map from ego floor points (x right, z back) to world ones (x, z)."""
        cos, sin = np.cos(self.heading_rad), np.sin(self.heading_rad)
        return np.array([[cos, sin, self.position_xz[0]], [-sin, cos, self.position_xz[1]]])


def ego_frame(num_cells: int, cell_m: float, *, is_centred: bool) -> GridFrame:
    """Lay a square raster around the agent, in its own frame: the first row is the farthest ahead.

    Args:
        num_cells: Cells along an edge.
        cell_m: Edge of a cell, metres.
        is_centred: Whether the agent is in the middle (UPEN); else under the middle of the last row (OccAnt).
    """
    size_m = num_cells * cell_m
    return GridFrame(
        (-0.5 * size_m, -0.5 * size_m if is_centred else -size_m), cell_m, (num_cells, num_cells)
    )


def centred_frame(center_xz: ArrayLike, num_cells: int, cell_m: float) -> GridFrame:
    """Lay a square raster around a floor point, the start of an episode, in the world frame."""
    x, z = np.asarray(center_xz, np.float64) - 0.5 * num_cells * cell_m
    return GridFrame((float(x), float(z)), cell_m, (num_cells, num_cells))


def to_ego(
    values: NDArray[np.float32], frame: GridFrame, ego: GridFrame, pose: FloorPose, fill: float
) -> NDArray[np.float32]:
    """Cut a square around the agent out of a registered raster and turn it to the agent's heading.

    Args:
        values: (C, rows, columns) float32.
        frame: Where these cells lie, world frame.
        ego: The square, see `ego_frame`.
        pose: Where the agent is.
        fill: Value beyond the raster.

    Returns:
        (C, h, w) float32, interpolated bilinearly.
    """
    return _resample(values, frame, ego, pose.world_from_ego, fill)


def to_registered(
    values: NDArray[np.float32], ego: GridFrame, frame: GridFrame, pose: FloorPose, fill: float
) -> tuple[Window, NDArray[np.float32]]:
    """Put a square around the agent back on a registered raster.

    Args:
        values: (C, h, w) float32 on the square.
        ego: The square.
        frame: The registered raster, world frame.
        pose: Where the agent is.
        fill: Value outside of the square.

    Returns:
        The rows and columns of the raster that hold the square, and (C, rows, columns) float32 values there.
    """
    window, inner = window_of(frame, ego, pose)
    turn = pose.world_from_ego
    back = np.concatenate([turn[:, :2].T, -turn[:, :2].T @ turn[:, 2:]], axis=1)
    return window, _resample(values, ego, inner, back, fill)


def window_of(frame: GridFrame, ego: GridFrame, pose: FloorPose) -> tuple[Window, GridFrame]:
    """Rows and columns of a registered raster that hold an ego square; one cell at least."""
    low = np.asarray(ego.origin_xz)
    high = low + ego.cell_m * np.asarray(ego.shape[::-1])
    corners = np.array([[low[0], low[1]], [low[0], high[1]], [high[0], low[1]], [high[0], high[1]]])
    return window_around(frame, corners @ pose.world_from_ego[:, :2].T + pose.world_from_ego[:, 2])


def window_around(frame: GridFrame, points_xz: NDArray[np.floating]) -> tuple[Window, GridFrame]:
    """Rows and columns of a registered raster that hold (N, 2) floor points; one cell at least.

    Returns:
        The rows and columns, and the raster that they make.
    """
    bounds = np.array([[0.0, 0.0]]) if len(points_xz) == 0 else _box(points_xz)
    cells = frame.cells_of(bounds)
    first = np.clip(cells.min(axis=0), 0, np.asarray(frame.shape) - 1)
    last = np.clip(cells.max(axis=0), first, np.asarray(frame.shape) - 1) + 1
    x, z = np.asarray(frame.origin_xz) + frame.cell_m * first[::-1]
    shape = (int(last[0] - first[0]), int(last[1] - first[1]))
    return np.s_[first[0] : last[0], first[1] : last[1]], GridFrame((float(x), float(z)), frame.cell_m, shape)


@final
class BayesGrid:
    """Products of class probabilities, cell by cell; several maps at once on the same raster.

    Args:
        frame: Where the cells lie, world frame.
        num_maps: Maps, such as one for each member of an ensemble.
        num_classes: Classes; all are equally likely at first.
        floor: Probability under which no class falls; 0 lets a cell become certain for good, as published.

    Source:
        UPEN's released code; the floor is ours.
    """

    def __init__(
        self, frame: GridFrame, num_maps: int = 1, num_classes: int = 3, floor: float = 1e-3
    ) -> None:
        if not 0.0 <= floor < 1.0 / num_classes:
            raise ValueError(f"`floor` must be in [0, 1 / num_classes), got {floor}")
        self.frame, self.floor = frame, floor
        self.uniform = 1.0 / num_classes
        """Prior of every class; what a frame says of cells that it does not see."""
        self.probabilities = np.full((num_maps, num_classes, *frame.shape), self.uniform, np.float32)
        """(M, classes, rows, columns) float32."""

    def fuse(self, window: Window, observed: NDArray[np.float32]) -> None:
        """Multiply in what a frame says of a window, (M, classes, rows, columns) float32 probabilities."""
        product = self.probabilities[:, :, window[0], window[1]] * observed
        product /= np.maximum(product.sum(axis=1, keepdims=True), np.float32(1e-30))
        if self.floor > 0.0:
            np.maximum(product, np.float32(self.floor), out=product)
            product /= product.sum(axis=1, keepdims=True)
        self.probabilities[:, :, window[0], window[1]] = product


@final
class RunningAverageGrid:
    """Two probabilities of each cell, occupied and explored, as running averages.

    Args:
        frame: Where the cells lie, world frame.
        keep_share: Weight of the old value of a known cell.
        min_explored: A frame writes the cells that it holds explored with more than this probability.

    Source:
        OccAnt's released code.
    """

    def __init__(
        self, frame: GridFrame, keep_share: float = KEEP_SHARE, min_explored: float = MIN_EXPLORED
    ) -> None:
        if not 0.0 <= keep_share < 1.0:
            raise ValueError(f"`keep_share` must be in [0, 1), got {keep_share}")
        self.frame, self.keep_share, self.min_explored = frame, keep_share, min_explored
        self.probabilities = np.zeros((2, *frame.shape), np.float32)
        """(2, rows, columns) float32: occupied, explored."""
        self.is_known = np.zeros(frame.shape, bool)
        """(rows, columns): written before."""

    def fuse(self, window: Window, observed: NDArray[np.float32]) -> None:
        """Average in what a frame says of a window, (2, rows, columns) float32: occupied, explored."""
        old, is_known = self.probabilities[:, window[0], window[1]], self.is_known[window]
        is_written = observed[1] > self.min_explored
        share = np.where(is_known, np.float32(self.keep_share), np.float32(0.0))
        mixed = share * old + (1.0 - share) * observed
        self.probabilities[:, window[0], window[1]] = np.where(is_written, mixed, old)
        self.is_known[window] = is_known | is_written


def _box(points_xz: NDArray[np.floating]) -> NDArray[np.floating]:
    return np.stack([points_xz.min(axis=0), points_xz.max(axis=0)])


def _resample(
    values: NDArray[np.float32],
    source: GridFrame,
    target: GridFrame,
    source_from_target: NDArray[np.float64],
    fill: float,
) -> NDArray[np.float32]:
    """Interpolate (C, rows, columns) at the centres of another raster that is turned and shifted."""
    turn, shift = source_from_target[:, :2], source_from_target[:, 2]
    # OpenCV counts columns and rows between the centres of pixels.
    scale = target.cell_m / source.cell_m
    first = np.asarray(target.origin_xz) + 0.5 * target.cell_m
    origin = (turn @ first + shift - np.asarray(source.origin_xz)) / source.cell_m - 0.5
    matrix = np.concatenate([scale * turn, origin[:, None]], axis=1)
    size = (target.shape[1], target.shape[0])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    parts = []
    for begin in range(0, len(values), _CHANNELS_AT_ONCE):
        block = np.ascontiguousarray(np.moveaxis(values[begin : begin + _CHANNELS_AT_ONCE], 0, -1))
        border = (fill,) * 4
        warped = cv2.warpAffine(
            block, matrix, size, flags=flags, borderMode=cv2.BORDER_CONSTANT, borderValue=border
        )
        parts.append(np.moveaxis(warped.reshape(*target.shape, block.shape[-1]), -1, 0))
    return np.ascontiguousarray(np.concatenate(parts))
