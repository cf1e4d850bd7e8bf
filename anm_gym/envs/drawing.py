"""Drawing on the floor in metres: a canvas, and the colours of time and depth.

What a whole picture of an episode looks like is decided in `picture`.
"""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.geometry import forward_xz

Image = NDArray[np.uint8]
"""(H, W, 3) uint8 RGB."""
Color = tuple[int, int, int]

WHITE: Final[Color] = (255, 255, 255)

_SHIFT: Final = 4
"""Bits of a pixel's fraction that OpenCV is given."""
_AGENT_SHAPE: Final = np.array([[1.0, 0.0], [-0.7, 0.75], [-0.35, 0.0], [-0.7, -0.75]])
"""Corners of the agent's arrow: ahead and to the right, in lengths of the arrow."""


@dataclass(frozen=True, eq=False)
class Canvas:
    """A picture of the floor from above, x to the right and z down, to be drawn upon in metres.

    Drawing changes `image`; everything is smoothed and may lie outside.
    """

    image: Image
    """(H, W, 3) uint8 RGB, in C order; changed in place."""
    origin_xz: tuple[float, float]
    """Floor point of the upper left corner, metres."""
    px_per_m: float
    """Pixels to a metre."""

    def pixels_of(self, points_xz: ArrayLike) -> NDArray[np.float64]:
        """Pixels (right, down) of (N, 2) floor points, (N, 2) float64; 0 is the image's edge."""
        points = np.atleast_2d(np.asarray(points_xz, np.float64))
        return np.asarray((points - self.origin_xz) * self.px_per_m)

    def path(self, points_xz: ArrayLike, colors: NDArray[np.uint8], width_px: int = 3) -> None:
        """Draw (N, 2) points as a line whose N - 1 pieces have the (N - 1, 3) colours."""
        points = self._fixed(points_xz)
        for start, end, color in zip(points[:-1], points[1:], colors.tolist(), strict=True):
            cv2.line(self.image, start.tolist(), end.tolist(), color, width_px, cv2.LINE_AA, _SHIFT)

    def area(self, corners_xz: ArrayLike, color: Color, opacity: float = 1.0) -> None:
        """Fill a polygon of (N, 2) corners, letting the floor shine through."""
        overlay = self.image.copy()
        cv2.fillPoly(overlay, [self._fixed(corners_xz)], color, cv2.LINE_AA, _SHIFT)
        cv2.addWeighted(overlay, opacity, self.image, 1.0 - opacity, 0.0, dst=self.image)

    def disc(self, point_xz: ArrayLike, radius_px: float, color: Color, rim: Color = WHITE) -> None:
        """Draw a disc with a thin rim."""
        (center,) = self._fixed(point_xz).tolist()
        for radius, paint in ((radius_px + 1.5, rim), (radius_px, color)):
            cv2.circle(self.image, center, round(radius * 2**_SHIFT), paint, -1, cv2.LINE_AA, _SHIFT)

    def pin(self, point_xz: ArrayLike, size_px: float, color: Color, rim: Color = WHITE) -> None:
        """Draw a marker whose tip is at a point: a drop with a hole."""
        tip = self.pixels_of(point_xz)[0]
        head = tip - [0.0, 1.6 * size_px]
        for grow, paint in ((1.5, rim), (0.0, color)):
            radius = size_px + grow
            wings = head + np.array([[-0.92, 0.4], [0.92, 0.4]]) * radius
            corners = np.vstack([wings, tip + np.array([0.0, grow])])
            cv2.fillPoly(self.image, [_to_fixed(corners)], paint, cv2.LINE_AA, _SHIFT)
            self._circle(head, radius, paint)
        self._circle(head, 0.4 * size_px, rim)

    def agent(self, position_xz: ArrayLike, heading_rad: float, color: Color, size_px: float = 11.0) -> None:
        """Draw the agent as an arrow along its heading."""
        ahead = forward_xz(heading_rad)
        right = np.array([-ahead[1], ahead[0]])
        center = self.pixels_of(position_xz)[0]
        for size, paint in ((size_px + 3.0, WHITE), (size_px, color)):
            corners = center + size * (_AGENT_SHAPE @ np.stack([ahead, right]))
            cv2.fillPoly(self.image, [_to_fixed(corners)], paint, cv2.LINE_AA, _SHIFT)

    def _circle(self, center_px: NDArray[np.float64], radius_px: float, color: Color) -> None:
        center = _to_fixed(center_px).tolist()
        cv2.circle(self.image, center, round(radius_px * 2**_SHIFT), color, -1, cv2.LINE_AA, _SHIFT)

    def _fixed(self, points_xz: ArrayLike) -> NDArray[np.int32]:
        return _to_fixed(self.pixels_of(points_xz))


def time_colors(num_steps: int) -> NDArray[np.uint8]:
    """Colours of steps from first (dark) to last (bright), (N, 3) uint8 RGB of Matplotlib's plasma."""
    return _mapped(np.linspace(0.0, 0.9, num_steps), cv2.COLORMAP_PLASMA)


def depth_colors(depth_m: NDArray[np.float32], max_depth_m: float) -> Image:
    """Colour a depth image, near bright and far dark, by the perceptually uniform magma.

    Args:
        depth_m: (H, W) float32 metres; 0 is empty and becomes black.
        max_depth_m: What is drawn darkest, metres.
    """
    nearness = 1.0 - np.clip(depth_m / max_depth_m, 0.0, 1.0)
    colors = _mapped(0.08 + 0.9 * nearness**1.3, cv2.COLORMAP_MAGMA)
    colors[depth_m <= 0.0] = 0
    return colors


def _mapped(shares: NDArray[np.floating], colormap: int) -> NDArray[np.uint8]:
    """Colours (..., 3) RGB of shares in [0, 1]."""
    if shares.size == 0:
        return np.zeros((*shares.shape, 3), np.uint8)
    flat = np.round(255.0 * shares).astype(np.uint8).reshape(-1, 1)
    colors = cv2.applyColorMap(flat, colormap)[..., ::-1]
    return np.ascontiguousarray(colors.reshape(*shares.shape, 3), np.uint8)


def _to_fixed(pixels: NDArray[np.float64]) -> NDArray[np.int32]:
    """Pixels in OpenCV's fixed-point numbers, whose pixel centres are whole."""
    return np.asarray(np.round((pixels - 0.5) * 2**_SHIFT), np.int32)
