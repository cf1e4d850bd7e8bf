"""Homes seen from above, for learning where to go without casting rays at meshes.

A world is a raster of the highest obstacle over each cell. A camera looks over low furniture and not
over high, so visibility needs heights but no triangles. The environment on top is `train.occant.twin`.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from anm_gym.checks import check_at_least, check_positive
from anm_gym.metrics.pooling import pooled
from anm_gym.scenes.catalog import make_scene
from anm_gym.scenes.scene import Scene
from anm_gym.sim.grid import GridFrame
from anm_gym.sim.raster import rasterise_slab
from anm_gym.sim.traversable import TraversableGrid

SLABS_M: Final = (0.2, 0.45, 0.7, 0.95, 1.2, 1.5)
"""Bounds of the slabs of heights in which obstacles are looked for, metres; the ends are OccAnt's."""
FINE_PER_CELL: Final = 2
"""Cells of the raster of triangles along a cell of the world."""
BORDER_M: Final = 0.2
"""Floor and obstacles this near to where the body's centre fits belong to the layout, metres."""
LARGEST: Final = 1
"""Label of the part on which episodes are played."""
VOID_M: Final = -100.0
"""Height where there is neither floor nor obstacle: so deep that it is never seen."""


@dataclass(frozen=True, eq=False)
class TwinWorld:
    """One storey as a raster of heights."""

    name: str
    """The scene's name."""
    frame: GridFrame
    """Where the cells lie."""
    top_m: NDArray[np.float32]
    """(rows, columns) top of the highest obstacle between 0.2 and 1.5 m, metres above the floor; 0 where
    there is floor alone, `VOID_M` where there is nothing."""
    navigable: NDArray[np.bool_]
    """(rows, columns): the body's centre fits, and the start can be reached."""

    @classmethod
    def of(cls, scene: Scene | str, cell_m: float) -> "TwinWorld":
        """Rasterise a scene.

        Args:
            scene: The scene or its name.
            cell_m: Edge of a cell, metres.
        """
        scene = make_scene(scene) if isinstance(scene, str) else scene
        grid = TraversableGrid.from_mesh(scene.storey_mesh, scene.floor_y_m, cell_m=cell_m / FINE_PER_CELL)
        top_m = np.zeros(grid.frame.shape, np.float32)
        for low_m, high_m in pairwise(SLABS_M):
            low_y_m, high_y_m = scene.floor_y_m + low_m, scene.floor_y_m + high_m
            top_m[rasterise_slab(scene.storey_mesh.triangles, grid.frame, low_y_m, high_y_m)] = high_m
        tops_m = np.asarray(pooled(np.maximum, top_m, FINE_PER_CELL), np.float32)
        has_floor, navigable = (
            pooled(np.maximum, mask, FINE_PER_CELL) > 0
            for mask in (grid.has_floor, grid.component == LARGEST)
        )
        tops_m[(tops_m == 0.0) & ~has_floor] = VOID_M
        return cls(scene.name, GridFrame(grid.frame.origin_xz, cell_m, tops_m.shape), tops_m, navigable)

    @cached_property
    def layout(self) -> NDArray[np.bool_]:
        """(rows, columns): floor around the navigable part, and what bounds it."""
        border = round(BORDER_M / self.frame.cell_m)
        near = ndimage.binary_dilation(self.navigable, iterations=border)
        return np.asarray(near & (self.top_m > VOID_M))

    @cached_property
    def layout_m2(self) -> float:
        """Area of the layout, square metres."""
        return float(self.layout.sum() * self.frame.cell_m**2)

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """(K, 2) cells in which an episode may begin."""
        return np.argwhere(self.navigable)

    def tops_at(self, points_xz: NDArray[np.floating]) -> NDArray[np.float32]:
        """Heights at floor points (..., 2), metres; beyond the raster there is nothing."""
        scaled = (points_xz - np.asarray(self.frame.origin_xz, np.float32)) * np.float32(
            1.0 / self.frame.cell_m
        )
        cells = np.floor(scaled).astype(np.int32) + 1
        rows = np.clip(cells[..., 1], 0, self._padded.shape[0] - 1)
        columns = np.clip(cells[..., 0], 0, self._padded.shape[1] - 1)
        return np.asarray(self._padded[rows, columns])

    def is_navigable(self, position_xz: NDArray[np.floating]) -> bool:
        """Tell whether the body's centre may be at a floor point."""
        row, column = self.frame.cells_of(position_xz)[0]
        rows, columns = self.frame.shape
        return bool(0 <= row < rows and 0 <= column < columns and self.navigable[row, column])

    @cached_property
    def _padded(self) -> NDArray[np.float32]:
        return np.pad(self.top_m, 1, constant_values=VOID_M)


@dataclass(frozen=True)
class FanSettings:
    """The rays of a camera in a raster of heights."""

    hfov_deg: float = 90.0
    """Horizontal field of view, degrees."""
    vfov_deg: float = 90.0
    """Vertical field of view, degrees: what lies below it is not seen."""
    sensor_height_m: float = 1.25
    """Height of the camera, metres."""
    range_m: float = 6.4
    """Planar depth up to which it sees, metres."""
    columns: int = 128
    """Number of rays."""
    step_m: float = 0.1
    """Distance of the samples along the optical axis, metres."""

    def __post_init__(self) -> None:
        check_positive(self, "hfov_deg", "vfov_deg", "sensor_height_m", "range_m", "step_m")
        check_at_least(self, 1, "columns")


class RayFan:
    """Samples along the rays of a camera, in the frame of the agent.

    Args:
        settings: Rays.
    """

    def __init__(self, settings: FanSettings) -> None:
        self.settings = settings
        slope = np.tan(np.deg2rad(settings.hfov_deg) / 2.0)
        side = slope * ((np.arange(settings.columns) + 0.5) * 2.0 / settings.columns - 1.0)
        ahead = np.arange(0.5 * settings.step_m, settings.range_m, settings.step_m)
        self.ahead_m = np.broadcast_to(ahead[:, None], (len(ahead), len(side))).astype(np.float32)
        """(samples, rays) metres ahead of the agent."""
        self.right_m = (ahead[:, None] * side).astype(np.float32)
        """(samples, rays) metres to its right."""
        self._range_m = np.hypot(self.ahead_m, self.right_m)
        self._drop_m = self.ahead_m * np.float32(np.tan(np.deg2rad(settings.vfov_deg) / 2.0))

    def tops(self, world: TwinWorld, poses: NDArray[np.floating]) -> NDArray[np.float32]:
        """Look the heights under the samples up.

        Args:
            world: Where the agent is.
            poses: (N, 3) x, z in metres and heading in radians, world frame.

        Returns:
            (N, samples, rays) float32 metres.
        """
        return world.tops_at(self.points_xz(poses))

    def points_xz(self, poses: NDArray[np.floating]) -> NDArray[np.float32]:
        """(N, samples, rays, 2) floor points of the samples, metres, world frame."""
        pose = np.asarray(poses, np.float32)[:, :, None, None]
        sin, cos = np.sin(pose[:, 2]), np.cos(pose[:, 2])
        x = pose[:, 0] - sin * self.ahead_m + cos * self.right_m
        z = pose[:, 1] - cos * self.ahead_m - sin * self.right_m
        return np.stack([x, z], axis=-1)

    def visible(self, tops_m: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Tell which samples the camera sees, over what is lower than it and not through anything.

        Args:
            tops_m: (N, samples, rays) heights.

        Returns:
            (N, samples, rays) bool.
        """
        height_m = np.float32(self.settings.sensor_height_m)
        slope = (tops_m - height_m) / self._range_m
        before = np.full_like(slope, -np.inf)
        np.maximum.accumulate(slope[:, :-1], axis=1, out=before[:, 1:])
        return np.asarray((slope >= before) & (tops_m >= height_m - self._drop_m))

    def swept(self, tops_m: NDArray[np.float32], wall_m: float) -> NDArray[np.bool_]:
        """Tell which samples come before, or on, the first obstacle of at least a height."""
        is_wall = tops_m >= wall_m
        behind = np.zeros_like(is_wall)
        np.logical_or.accumulate(is_wall[:, :-1], axis=1, out=behind[:, 1:])
        return ~behind
