"""A view into an open storey, the same for several surfaces, so that pictures side by side can be compared.

`train.reconstruction` fits its picture to one mesh; here the frame is given and the colours are the
caller's.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.backends import make_depth_camera
from train.reconstruction import LIGHT

TILT_DEG: Final = 24.0
"""Angle between the view and the vertical, degrees: walls show their faces, rooms their floors."""


@dataclass(frozen=True, eq=False)
class Sight:
    """What a view shows, pixel by pixel."""

    is_hit: NDArray[np.bool_]
    """(H, W) whether there is surface."""
    points: NDArray[np.float32]
    """(N, 3) where the N hit pixels lie, metres, world frame."""
    shade: NDArray[np.float64]
    """(N,) brightness in [0, 1] by the surface's slope."""

    def image(self, colors: NDArray[np.floating]) -> NDArray[np.float64]:
        """Paint the hit pixels with (N, 3) colours in [0, 1], shaded, on white; (H, W, 3)."""
        picture = np.ones((*self.is_hit.shape, 3))
        picture[self.is_hit] = colors * self.shade[:, None]
        return picture


@dataclass(frozen=True)
class OpenView:
    """A parallel view from above, tilted towards -z, of what lies under a height.

    Raises:
        ValueError: If the image has no width.
    """

    bounds: NDArray[np.float64]
    """(2, 3) box that must be in view, metres; its top is where the storey is cut open."""
    width_px: int = 560
    """Width of the image, pixels."""

    def __post_init__(self) -> None:
        if self.width_px < 1:
            raise ValueError(f"`width_px` must be >= 1, got {self.width_px}")

    @property
    def down(self) -> NDArray[np.float64]:
        """(3,) direction of sight."""
        tilt = np.deg2rad(TILT_DEG)
        return np.array([0.0, -np.cos(tilt), -np.sin(tilt)])

    @property
    def span_m(self) -> tuple[float, float]:
        """Width and height of the image, metres at the image plane."""
        x, y, z = self.bounds[1] - self.bounds[0]
        tilt = np.deg2rad(TILT_DEG)
        return float(x), float(z * np.cos(tilt) + y * np.sin(tilt))

    def see(self, mesh: TriangleMesh) -> Sight:
        """Cast one ray per pixel into a mesh; faces that show their back are left out.

        Args:
            mesh: A surface whose faces look into free space.
        """
        width_m, height_m = self.span_m
        pixel_m = width_m / self.width_px
        rows, columns = np.mgrid[: round(height_m / pixel_m), : self.width_px]
        shape = rows.shape
        origins = self._origins((columns.ravel() + 0.5) * pixel_m, (rows.ravel() + 0.5) * pixel_m)
        facing = mesh.normals @ self.down < 0.0
        if not facing.any():
            return Sight(np.zeros(shape, bool), np.zeros((0, 3), np.float32), np.zeros(0))
        shown = TriangleMesh(mesh.vertices, mesh.faces[facing])
        directions = np.tile(self.down.astype(np.float32), (len(origins), 1))
        hits = make_depth_camera(shown, CameraSpec(1, 1)).cast(origins, directions)
        is_hit = (hits.triangle >= 0) & np.isfinite(hits.distance)
        points = origins[is_hit] + hits.distance[is_hit, None] * directions[is_hit]
        light = np.clip(shown.normals[hits.triangle[is_hit]] @ LIGHT, -0.5, 1.0)
        return Sight(is_hit.reshape(shape), points, 0.66 + 0.34 * light)

    def project(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Place (N, 3) world points in the image, (N, 2) columns and rows, pixels."""
        tilt = np.deg2rad(TILT_DEG)
        offset = np.asarray(points, np.float64) - self._corner
        right = offset[:, 0]
        lower = offset[:, 2] * np.cos(tilt) - offset[:, 1] * np.sin(tilt)
        return np.stack([right, lower], axis=1) * self.width_px / self.span_m[0]

    @property
    def _corner(self) -> NDArray[np.float64]:
        """World point of the image's upper left corner, on the plane of the cut."""
        low, high = self.bounds
        return np.array([low[0], high[1], low[2]])

    def _origins(self, right_m: NDArray[np.float64], lower_m: NDArray[np.float64]) -> NDArray[np.float32]:
        """Start rays on the plane of the cut."""
        along_z_m = lower_m / np.cos(np.deg2rad(TILT_DEG))
        offsets = np.stack([right_m, np.zeros_like(right_m), along_z_m], axis=1)
        return np.ascontiguousarray(self._corner + offsets, np.float32)
