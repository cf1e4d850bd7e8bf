"""The picture of one moment of an episode: the storey from above beside what the camera sees."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow
from PIL import ImageDraw, ImageFont

from anm_gym.envs.drawing import Canvas, Color, Image, depth_colors, time_colors
from anm_gym.geometry import forward_xz
from anm_gym.scenes.scene import Scene
from anm_gym.scenes.topdown import PAPER, TopDown
from anm_gym.sim.simulator import AgentState, Simulator

HEIGHT_PX: Final = 540
WIDTH_PX: Final = 960

_MARGIN_PX: Final = 18
_PLAN_PX: Final = HEIGHT_PX - 2 * _MARGIN_PX
_SIDE_PX: Final = 360
"""Width of the column with the depth image and the captions."""
_DEPTH_PX: Final = 340
"""Height of the space for the depth image."""
_BAR_PX: Final = 8
"""Height of the depth image's colour bar."""
_FOV_REACH_M: Final = 3.0
_SCALES_M: Final = (0.01, 0.1, 0.5, 1, 2, 5, 10, 20, 50, 100)
_LONGEST_SCALE_PX: Final = 100

_INK: Final[Color] = (38, 44, 52)
_FADED: Final[Color] = (122, 128, 134)
_FOG: Final[Color] = PAPER
_AGENT: Final[Color] = (226, 87, 42)
_VIEW: Final[Color] = (255, 196, 60)
_START: Final[Color] = (38, 44, 52)
_GOAL: Final[Color] = (204, 44, 92)
_FOG_OPACITY: Final = 0.72
_SEEN_REACH_M: Final = 0.3
"""How far from seen floor the fog has lifted, metres: the body's radius and a little."""


@dataclass(frozen=True, eq=False)
class Moment:
    """What there is to draw of one step."""

    simulator: Simulator
    """The agent in its scene."""
    trajectory: Sequence[AgentState]
    """Where the agent has been."""
    depth_m: NDArray[np.float32]
    """(H, W) float32 depth as observed, metres."""
    captions: Mapping[str, str]
    """Names and values to write."""
    is_seen: NDArray[np.bool_] | None = None
    """(rows, columns) which floor has been seen, on the grid's cells or coarser ones; None for no fog."""
    goal_xz: NDArray[np.float64] | None = None
    """(2,) the goal, metres; None without one."""


def draw_moment(scene: Scene, moment: Moment) -> Image:
    """Draw one step of an episode.

    Left the storey from above: unseen floor under fog, the trail from dark (early) to bright (late),
    the start as a dark disc, the agent as an arrow in its field of view, the goal as a pin. Right the
    depth image, near bright and far dark, and the captions.

    Args:
        scene: Where the episode is played.
        moment: What to draw.

    Returns:
        (540, 960, 3) uint8 RGB.
    """
    page = np.empty((HEIGHT_PX, WIDTH_PX, 3), np.uint8)
    page[:] = PAPER
    plan = _draw_plan(scene, moment)
    free_px = WIDTH_PX - _SIDE_PX - 2 * _MARGIN_PX
    _paste(page, plan.image, (_MARGIN_PX + (free_px - plan.image.shape[1]) // 2 - 9, HEIGHT_PX // 2))
    _draw_depth(page, moment)
    return _write(page, scene.name, moment, plan.px_per_m)


def _draw_plan(scene: Scene, moment: Moment) -> Canvas:
    plan = _plan_of(scene)
    canvas = Canvas(plan.image.copy(), plan.origin_xz, plan.px_per_m)
    if moment.is_seen is not None:
        _cover(canvas, moment.simulator, moment.is_seen)
    agent = moment.trajectory[-1]
    canvas.area(_field_of_view(moment), _VIEW, opacity=0.4)
    points_xz = np.stack([state.position_xz for state in moment.trajectory])
    canvas.path(points_xz, time_colors(len(points_xz) - 1))
    canvas.disc(points_xz[0], 5.0, _START)
    if moment.goal_xz is not None:
        canvas.pin(moment.goal_xz, 8.0, _GOAL)
    canvas.agent(agent.position_xz, agent.heading_rad, _AGENT)
    return canvas


@lru_cache(maxsize=4)
def _plan_of(scene: Scene) -> Canvas:
    """Paint the storey once for all pictures of a scene."""
    view = TopDown.of(scene, _PLAN_PX)
    return Canvas(view.paint(), view.frame.origin_xz, view.px_per_m)


def _cover(canvas: Canvas, simulator: Simulator, is_seen: NDArray[np.bool_]) -> None:
    """Lay fog over all that is not near floor that has been seen."""
    frame = simulator.grid.frame
    stride = round(frame.shape[0] / is_seen.shape[0])
    scale = canvas.px_per_m * frame.cell_m * stride
    x, z = canvas.pixels_of(frame.centers_of([0, 0]))[0]
    to_page = np.array([[scale, 0.0, x], [0.0, scale, z]])
    size_px = (canvas.image.shape[1], canvas.image.shape[0])
    near = cv2.warpAffine(is_seen.astype(np.float32), to_page, size_px)
    reach = 2 * round(_SEEN_REACH_M * canvas.px_per_m) + 1
    near = cv2.dilate(near, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach)))
    near = cv2.GaussianBlur(near, (0, 0), max(1.0, 0.06 * canvas.px_per_m))[..., None]
    opacity = _FOG_OPACITY * (1.0 - near)
    canvas.image[:] = np.round((1.0 - opacity) * canvas.image + opacity * np.array(_FOG, np.float32))


def _field_of_view(moment: Moment) -> NDArray[np.float64]:
    """Corners (N, 2) of what the row of pixels at the horizon sees, at most 3 m away, metres."""
    agent, spec = moment.trajectory[-1], moment.simulator.camera.spec
    depth_m = moment.depth_m[spec.height_px // 2].astype(np.float64)
    right = spec.directions[0, :, 0].astype(np.float64)
    depth_m[depth_m <= 0.0] = _FOV_REACH_M
    depth_m = np.minimum(depth_m, _FOV_REACH_M / np.hypot(1.0, right))
    ahead_xz = forward_xz(agent.heading_rad)
    right_xz = np.array([-ahead_xz[1], ahead_xz[0]])
    rim = agent.position_xz + depth_m[:, None] * (ahead_xz + right[:, None] * right_xz)
    return np.vstack([agent.position_xz, rim])


def _draw_depth(page: Image, moment: Moment) -> None:
    """Fit the depth image into its place and put the colour bar under it."""
    max_depth_m = moment.simulator.camera.spec.max_depth_m
    colors = depth_colors(moment.depth_m, max_depth_m)
    scale = min(_SIDE_PX / colors.shape[1], _DEPTH_PX / colors.shape[0])
    how = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_NEAREST if scale > 3.0 else cv2.INTER_LINEAR
    size_px = (max(1, round(scale * colors.shape[1])), max(1, round(scale * colors.shape[0])))
    image = np.asarray(cv2.resize(colors, size_px, interpolation=how), np.uint8)
    left = WIDTH_PX - _MARGIN_PX - _SIDE_PX
    _paste(page, image, (left + (_SIDE_PX - image.shape[1]) // 2, _MARGIN_PX + _DEPTH_PX // 2))
    ramp = np.linspace(1e-3, max_depth_m, _SIDE_PX, dtype=np.float32)
    top = _MARGIN_PX + _DEPTH_PX + 8
    page[top : top + _BAR_PX, left : left + _SIDE_PX] = depth_colors(ramp[None], max_depth_m)


def _paste(page: Image, image: Image, left_middle_px: tuple[int, int]) -> None:
    """Put an image on the page by the middle of its left edge."""
    left, top = left_middle_px[0], left_middle_px[1] - image.shape[0] // 2
    page[top : top + image.shape[0], left : left + image.shape[1]] = image


def _write(page: Image, title: str, moment: Moment, px_per_m: float) -> Image:
    """Write title, captions, the ends of the colour bar and a scale."""
    picture = Pillow.fromarray(page)
    draw = ImageDraw.Draw(picture)
    left, right = WIDTH_PX - _MARGIN_PX - _SIDE_PX, WIDTH_PX - _MARGIN_PX
    y = _MARGIN_PX + _DEPTH_PX + _BAR_PX + 18
    draw.text((left, y), "0 m", _FADED, _font(12), anchor="lm")
    limit_m = moment.simulator.camera.spec.max_depth_m
    draw.text((right, y), f"depth {limit_m:g} m", _FADED, _font(12), anchor="rm")
    draw.text((left, y + 34), title, _INK, _font(20), anchor="lm")
    length_m = max(length for length in _SCALES_M if length * px_per_m <= _LONGEST_SCALE_PX)
    draw.line((right - length_m * px_per_m, y + 42, right, y + 42), _INK, 2)
    draw.text((right, y + 37), f"{length_m:g} m", _FADED, _font(12), anchor="rb")
    column_px = _SIDE_PX / max(1, len(moment.captions))
    for rank, (name, value) in enumerate(moment.captions.items()):
        x = left + rank * column_px
        draw.text((x, y + 72), name, _FADED, _font(13), anchor="lm")
        draw.text((x, y + 94), value, _INK, _font(19), anchor="lm")
    return np.array(picture, np.uint8)


def _font(size_px: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size_px)
