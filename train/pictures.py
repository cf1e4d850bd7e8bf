"""Pictures of an episode: the trail from above with its goals, and what the camera saw on the way.

The environment's own `render` shows one moment; these pictures show the whole episode.
"""

from pathlib import Path
from typing import Any, Final

import cv2
import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from anm_gym.geometry import camera_pose, forward_xz
from anm_gym.sim.grid import GridFrame
from anm_gym.sim.simulator import Simulator
from anm_gym.whole_file import whole_file
from train.attribution import AttributionSettings, stuck_steps
from train.recorder import find_attribute
from train.trajectory import Trajectory

Image = NDArray[np.uint8]

WALL: Final = (70, 70, 74)
UNSEEN: Final = (214, 214, 210)
FLOOR: Final = (255, 255, 255)
OUTSIDE: Final = (240, 240, 238)
START: Final = (213, 94, 0)
INK: Final = (60, 60, 60)
FAILURE: Final = (220, 38, 38)

_LONG_SIDE_PX: Final = 1000
_FOOTER_PX: Final = 46
_SUBPIXEL_BITS: Final = 4


class FloorPicture:
    """A raster of the floor, enlarged, to be drawn upon in metres."""

    def __init__(self, colors: Image, frame: GridFrame) -> None:
        """Enlarge (rows, columns, 3) cell colours so that the long side has about 1000 pixels."""
        self._frame = frame
        self._scale = max(_LONG_SIDE_PX // max(frame.shape), 2)
        self.image: Image = np.repeat(np.repeat(colors, self._scale, axis=0), self._scale, axis=1)

    @property
    def px_per_m(self) -> float:
        """Pixels of a metre."""
        return self._scale / self._frame.cell_m

    def trail(self, points_xz: NDArray[np.float64], colors: NDArray[np.uint8], width_m: float = 0.06) -> None:
        """Draw (N, 2) points as a line whose N - 1 pieces have their own colours."""
        pixels = self._pixels(points_xz)
        width = max(int(width_m * self.px_per_m), 2)
        for start, end, color in zip(pixels[:-1], pixels[1:], colors, strict=True):
            cv2.line(self.image, start, end, color.tolist(), width, cv2.LINE_AA, _SUBPIXEL_BITS)

    def disc(self, point_xz: NDArray[np.float64], radius_m: float, color: Any, ring: Any = FLOOR) -> None:
        """Draw a disc with a ring around it."""
        (center,) = self._pixels(point_xz[None])
        radius = int(radius_m * self.px_per_m * 2**_SUBPIXEL_BITS)
        edge = int(1.5 * 2**_SUBPIXEL_BITS)
        cv2.circle(self.image, center, radius + edge, ring, -1, cv2.LINE_AA, _SUBPIXEL_BITS)
        cv2.circle(self.image, center, radius, tuple(map(int, color)), -1, cv2.LINE_AA, _SUBPIXEL_BITS)

    def cross(self, point_xz: NDArray[np.float64], radius_m: float, color: Any) -> None:
        """Draw a diagonal cross."""
        corners = [radius_m * np.array(corner) for corner in ((-1, -1), (1, 1), (-1, 1), (1, -1))]
        a, b, c, d = self._pixels(point_xz + np.array(corners))
        for start, end in ((a, b), (c, d)):
            cv2.line(self.image, start, end, color, 3, cv2.LINE_AA, _SUBPIXEL_BITS)

    def arrow(self, point_xz: NDArray[np.float64], heading_rad: float, color: Any) -> None:
        """Draw the agent as a triangle that points along its heading."""
        ahead = forward_xz(heading_rad)
        side = np.array([-ahead[1], ahead[0]])
        corners = [0.26 * ahead, -0.14 * ahead + 0.16 * side, -0.06 * ahead, -0.14 * ahead - 0.16 * side]
        pixels = np.array(self._pixels(point_xz + np.array(corners)), np.int32)
        cv2.fillPoly(self.image, [pixels], color, cv2.LINE_AA, _SUBPIXEL_BITS)
        cv2.polylines(self.image, [pixels], True, FLOOR, 1, cv2.LINE_AA, _SUBPIXEL_BITS)

    def _pixels(self, points_xz: NDArray[np.float64]) -> list[tuple[int, int]]:
        local = (points_xz - self._frame.origin_xz) * self.px_per_m * 2**_SUBPIXEL_BITS
        return [(int(x), int(y)) for x, y in local.round()]


def write_topdown(path: Path, env: gym.Env, trajectory: Trajectory) -> Path:
    """Draw the storey from above with what is known of its floor, the trail and the goals over time.

    Red are discs where the agent was stuck and crosses where goals were given up.

    Args:
        path: Where the PNG goes.
        env: The agent's environment at the end of the episode; its `occupancy` is drawn if it has one.
        trajectory: The episode.

    Returns:
        `path`.
    """
    simulator: Simulator = env.get_wrapper_attr("simulator")
    picture = FloorPicture(_floor_colors(simulator, find_attribute(env, "occupancy")), simulator.grid.frame)
    num_steps = len(trajectory.actions)
    picture.trail(trajectory.poses[:, :2], time_colors(np.arange(num_steps), num_steps))
    for goal, color in zip(trajectory.goals, time_colors(trajectory.goals[:, 2], num_steps), strict=True):
        picture.disc(goal[:2], 0.07, color, INK)
    for failure in trajectory.failures:
        picture.cross(failure[:2], 0.1, FAILURE)
    for place in _stuck_places(trajectory):
        picture.disc(place, 0.08, FAILURE)
    picture.disc(trajectory.poses[0, :2], 0.12, START)
    picture.arrow(trajectory.poses[-1, :2], trajectory.poses[-1, 2], START)
    image = _crop_outside(picture.image, 12)
    return save_picture(path, np.vstack([image, _footer(image.shape[1], picture.px_per_m, num_steps)]))


def write_montage(path: Path, env: gym.Env, trajectory: Trajectory, columns: int = 4, rows: int = 2) -> Path:
    """Draw the depth images at evenly spaced steps, near bright, empty black.

    Args:
        path: Where the PNG goes.
        env: The environment; its camera looks again from the recorded poses.
        trajectory: The episode.
        columns: Images side by side.
        rows: Rows of images.

    Returns:
        `path`.
    """
    simulator: Simulator = env.get_wrapper_attr("simulator")
    height_m = float(simulator.world_from_camera[1, 3])
    steps = np.linspace(0, len(trajectory.actions), columns * rows).round().astype(int)
    tiles = [_depth_tile(simulator, trajectory.poses[step], height_m, step) for step in steps]
    lines = [np.hstack(tiles[row * columns : (row + 1) * columns]) for row in range(rows)]
    return save_picture(path, np.vstack(lines))


def save_picture(path: Path, picture: Image) -> Path:
    """Write an (H, W, 3) RGB picture as PNG."""
    with whole_file(path) as draft:
        draft.write_bytes(cv2.imencode(".png", np.ascontiguousarray(picture[..., ::-1]))[1].tobytes())
    return path


def time_colors(steps: NDArray[Any], num_steps: int) -> NDArray[np.uint8]:
    """Colour steps from dark (early) to bright (late); (N, 3) uint8 RGB of Matplotlib's viridis."""
    share = np.clip(np.asarray(steps, np.float64) / max(num_steps, 1), 0.0, 1.0)
    return _colormap(230.0 * share, cv2.COLORMAP_VIRIDIS)


def _colormap(values: NDArray[np.float64], colormap: int) -> NDArray[np.uint8]:
    if values.size == 0:
        return np.zeros((*values.shape, 3), np.uint8)
    flat = cv2.applyColorMap(values.reshape(-1, 1).astype(np.uint8), colormap)
    return np.asarray(flat.reshape(*values.shape, 3)[..., ::-1], np.uint8)


def _floor_colors(simulator: Simulator, occupancy: Any) -> Image:
    """Colours of the true cells; floor that the agent's own map does not know as free is grey."""
    grid = simulator.grid
    colors = np.full((*grid.frame.shape, 3), OUTSIDE, np.uint8)
    colors[grid.has_floor] = FLOOR if occupancy is None else UNSEEN
    if occupancy is not None:
        cells = np.argwhere(grid.has_floor)
        known = occupancy.frame.cells_of(grid.frame.centers_of(cells))
        inside = occupancy.frame.contains(known)
        free = np.zeros(len(cells), bool)
        free[inside] = occupancy.free[tuple(known[inside].T)]
        colors[tuple(cells[free].T)] = FLOOR
    colors[grid.occupied] = WALL
    return colors


def _stuck_places(trajectory: Trajectory) -> NDArray[np.float64]:
    """(N, 2) where the agent was stuck, each place once."""
    if "collisions" not in trajectory.curves:
        return np.zeros((0, 2))
    is_stuck = stuck_steps(trajectory, AttributionSettings())
    return np.unique(trajectory.poses[:-1, :2][is_stuck].round(1), axis=0)


def _crop_outside(image: Image, margin_px: int) -> Image:
    is_scene = (image != np.array(OUTSIDE, np.uint8)).any(axis=2)
    spans = [np.flatnonzero(is_scene.any(axis=axis)) for axis in (1, 0)]
    if not len(spans[0]):
        return image
    rows, columns = (slice(max(span[0] - margin_px, 0), span[-1] + 1 + margin_px) for span in spans)
    return image[rows, columns]


def _footer(width_px: int, px_per_m: float, num_steps: int) -> Image:
    """A bar of the colours of time, and a scale of one metre."""
    footer = np.full((_FOOTER_PX, width_px, 3), 255, np.uint8)
    bar_px = min(220, width_px // 3)
    footer[12:22, 12 : 12 + bar_px] = time_colors(np.arange(bar_px), bar_px)
    _write(footer, "step 0", (12, 39))
    _write(footer, str(num_steps), (max(bar_px - 20, 80), 39))
    end = width_px - 14
    cv2.line(footer, (end - int(px_per_m), 17), (end, 17), INK, 2)
    _write(footer, "1 m", (end - 30, 39))
    return footer


def _depth_tile(simulator: Simulator, pose: NDArray[np.float64], height_m: float, step: int) -> Image:
    x, z, heading_rad = pose
    depth = simulator.camera.render(camera_pose([x, height_m, z], heading_rad))
    nearness = 255.0 * (1.0 - np.clip(depth / simulator.camera.spec.max_depth_m, 0.0, 1.0)) ** 1.5
    tile = _colormap(nearness, cv2.COLORMAP_MAGMA)
    tile[depth <= 0.0] = 0
    side = 256 / max(tile.shape[:2])
    tile = np.ascontiguousarray(cv2.resize(tile, None, fx=side, fy=side, interpolation=cv2.INTER_AREA))
    _write(tile, f"step {step}", (8, 20), (255, 255, 255))
    return np.asarray(np.pad(tile, ((2, 2), (2, 2), (0, 0)), constant_values=255), np.uint8)


def _write(image: Image, text: str, at: tuple[int, int], color: tuple[int, int, int] = INK) -> None:
    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, color, 1, cv2.LINE_AA)
