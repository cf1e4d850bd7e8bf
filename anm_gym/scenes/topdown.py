"""The plan of a storey as coloured pixels: floor, reachable parts, obstacles by height, walls.

Title, legend and scale are put around it by `picture`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from anm_gym.scenes.scene import Scene
from anm_gym.sim.grid import GridFrame
from anm_gym.sim.raster import rasterise_slab
from anm_gym.sim.traversable import TraversableGrid

Color = tuple[int, int, int]
Mask = NDArray[np.bool_]

PAPER: Final[Color] = (252, 251, 248)
WALL: Final[Color] = (46, 54, 64)
FLOOR: Final[Color] = (236, 231, 221)
REACHABLE: Final[Color] = (183, 220, 203)
CUT_OFF: Final[tuple[Color, ...]] = ((246, 214, 150), (212, 196, 233), (241, 190, 184), (186, 209, 236))
OBSTACLES: Final[tuple[tuple[float, float, Color], ...]] = (
    (0.1, 0.5, (222, 203, 174)),
    (0.5, 1.0, (197, 168, 129)),
    (1.0, 1.6, (158, 125, 86)),
)
"""Lower and upper height over the floor, metres, and colour."""

_SUPERSAMPLING: Final = 2
_WALL_BANDS_M: Final = ((0.3, 0.9), (1.7, 2.0))
_THICKEST_WALL_M: Final = 0.7
_THICKEST_CLOSED_M: Final = 0.2
_SHOWN_AROUND_M: Final = 2.0
_BORDER_M: Final = 0.2
_LEAST_CUT_OFF_M2: Final = 0.1


@dataclass(frozen=True, eq=False)
class TopDown:
    """A storey seen from above through a window on the floor, x to the right and z down the page."""

    scene: Scene
    """What is drawn."""
    grid: TraversableGrid
    """Where the default body can go."""
    frame: GridFrame
    """The window: twice as fine as the picture."""

    @classmethod
    def of(cls, scene: Scene, long_side_px: int) -> "TopDown":
        """Frame all that is navigable on the selected storey and the obstacles close to it."""
        grid = TraversableGrid.from_mesh(scene.mesh, scene.floor_y_m)
        away_m = ndimage.distance_transform_edt(~grid.navigable) * grid.frame.cell_m
        shown = np.argwhere((away_m <= _SHOWN_AROUND_M) & (grid.occupied | grid.navigable))
        low_xz, high_xz = grid.frame.centers_of(np.stack([shown.min(axis=0), shown.max(axis=0)]))
        longest_m = float((high_xz - low_xz).max()) + 2.0 * _BORDER_M
        frame = GridFrame.around(
            low_xz, high_xz, longest_m / (long_side_px * _SUPERSAMPLING), margin_m=_BORDER_M
        )
        return cls(scene, grid, frame)

    @property
    def px_per_m(self) -> float:
        """Pixels of the picture to a metre."""
        return 1.0 / (self.frame.cell_m * _SUPERSAMPLING)

    def pixel_of(self, point_xz: NDArray[np.float64]) -> tuple[float, float]:
        """Pixel (right, down) of a floor point."""
        right, down = (point_xz - self.frame.origin_xz) * self.px_per_m
        return float(right), float(down)

    def paint(self) -> NDArray[np.uint8]:
        """Paint layer over layer at twice the size, then shrink to smooth the edges; (H, W, 3) uint8 RGB."""
        rows, columns = self.frame.shape
        picture = np.empty((rows, columns, 3), np.uint8)
        picture[:] = PAPER
        for mask, color in self._layers():
            picture[mask] = color
        size_px = (columns // _SUPERSAMPLING, rows // _SUPERSAMPLING)
        return np.asarray(cv2.resize(picture, size_px, interpolation=cv2.INTER_AREA), np.uint8)

    @cached_property
    def cut_off_parts(self) -> tuple[int, ...]:
        """Labels of the parts that cannot be reached from the largest; wall cavities do not count."""
        areas = enumerate(self.grid.component_areas_m2, 1)
        large = [part for part, area in areas if part > 1 and area >= _LEAST_CUT_OFF_M2]
        cavity = self._cavities
        return tuple(part for part in large if not cavity[self._enlarged(self.grid.component == part)].any())

    def _layers(self) -> Iterator[tuple[Mask, Color]]:
        yield self._enlarged(self.grid.has_floor) & ~self._outside, FLOOR
        yield self._enlarged(self.grid.component == 1), REACHABLE
        for rank, part in enumerate(self.cut_off_parts):
            yield self._enlarged(self.grid.component == part), CUT_OFF[rank % len(CUT_OFF)]
        for mask, (_, _, color) in zip(self._obstacles, OBSTACLES, strict=True):
            yield mask, color
        yield _thickened(self._wall_lines) | self._cavities, WALL

    @cached_property
    def _obstacles(self) -> tuple[Mask, ...]:
        return tuple(self._between(low_m, high_m) for low_m, high_m, _ in OBSTACLES)

    @cached_property
    def _wall_lines(self) -> Mask:
        """Surfaces that are there both at hip and over head height: walls and tall cupboards."""
        lower, upper = (self._between(*band) for band in _WALL_BANDS_M)
        return lower & upper

    @cached_property
    def _regions(self) -> tuple[NDArray[np.int32], int]:
        """Connected regions of the window without any surface in it."""
        labels, count = ndimage.label(~np.logical_or.reduce([*self._obstacles, self._wall_lines]))
        return np.asarray(labels, np.int32), int(count)

    @cached_property
    def _cavities(self) -> Mask:
        """The inside of hollow walls: thin regions out of reach, mostly bounded by wall lines."""
        labels, count = self._regions
        padded = np.pad(labels > 0, 1).astype(np.uint8)
        depth_m = cv2.distanceTransform(padded, cv2.DIST_L2, 5)[1:-1, 1:-1] * self.frame.cell_m
        is_cavity = ndimage.maximum(depth_m, labels, np.arange(count + 1)) < 0.5 * _THICKEST_WALL_M
        rim = (labels > 0) & (cv2.erode(padded, np.ones((3, 3), np.uint8))[1:-1, 1:-1] == 0)
        at_wall = rim & _thickened(self._wall_lines)
        rim_px, at_wall_px = (np.bincount(labels[edge], minlength=count + 1) for edge in (rim, at_wall))
        is_cavity &= at_wall_px > 0.5 * rim_px
        is_cavity[labels[self._enlarged(self.grid.component == 1)]] = False
        is_cavity[self._border_labels] = False
        is_cavity[0] = False
        return np.asarray(is_cavity[labels]) | (self._outside & self._closed_walls)

    @property
    def _closed_walls(self) -> Mask:
        """Wall lines and what lies between two of them, a wall's thickness apart."""
        size = round(_THICKEST_CLOSED_M / self.frame.cell_m)
        kernel = np.ones((size, size), np.uint8)
        return np.asarray(cv2.morphologyEx(self._wall_lines.astype(np.uint8), cv2.MORPH_CLOSE, kernel) > 0)

    @cached_property
    def _outside(self) -> Mask:
        """Regions that reach the window's edge and hold no navigable place."""
        labels, count = self._regions
        is_outside = np.zeros(count + 1, bool)
        is_outside[self._border_labels] = True
        is_outside[labels[self._enlarged(self.grid.navigable)]] = False
        is_outside[0] = False
        return np.asarray(is_outside[labels])

    @property
    def _border_labels(self) -> NDArray[np.int32]:
        labels, _ = self._regions
        return np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])

    def _between(self, low_m: float, high_m: float) -> Mask:
        floor_m = self.scene.floor_y_m
        return rasterise_slab(self.scene.mesh.triangles, self.frame, floor_m + low_m, floor_m + high_m)

    def _enlarged(self, mask: Mask) -> Mask:
        """Resample a mask of the traversable grid in the window, with smooth outlines."""
        rows, columns = self.frame.shape
        ratio = self.frame.cell_m / self.grid.frame.cell_m
        shift = (np.array(self.frame.origin_xz) - self.grid.frame.origin_xz) / self.grid.frame.cell_m
        x = ((np.arange(columns) + 0.5) * ratio + shift[0] - 0.5).astype(np.float32)
        y = ((np.arange(rows) + 0.5) * ratio + shift[1] - 0.5).astype(np.float32)
        smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 0.8)
        map_x, map_y = np.meshgrid(x, y)
        return np.asarray(cv2.remap(smooth, map_x, map_y, cv2.INTER_LINEAR) > 0.5)


def _thickened(mask: Mask) -> Mask:
    """Grow a mask by one cell on every side."""
    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool))
