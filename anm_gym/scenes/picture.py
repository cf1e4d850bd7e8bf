"""A storey from above on a page: title, plan, areas, legend and scale bar."""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from scipy import ndimage

from anm_gym.scenes.scene import Scene
from anm_gym.scenes.topdown import CUT_OFF, FLOOR, OBSTACLES, PAPER, REACHABLE, WALL, Color, TopDown

_LONG_SIDE_PX: Final = 1100
_MIN_WIDTH_PX: Final = 860
_PAD_PX: Final = 36
_HEAD_PX: Final = 96
_FOOT_PX: Final = 70
_INK: Final[Color] = (38, 44, 52)
_FADED: Final[Color] = (122, 128, 134)
_LABELLED_DEPTH_M: Final = 0.6
_SCALES_M: Final = (0.5, 1, 2, 5, 10, 20, 50, 100)


def draw_storey(scene: Scene) -> NDArray[np.uint8]:
    """Draw the selected storey of a scene from above, x to the right and z down the page.

    Args:
        scene: What to draw.

    Returns:
        (H, W, 3) uint8 RGB picture with a title, areas in square metres, a scale bar and a legend.
    """
    view = TopDown.of(scene, _LONG_SIDE_PX)
    plan = Image.fromarray(view.paint())
    width_px = max(plan.width, _MIN_WIDTH_PX) + 2 * _PAD_PX
    page = Image.new("RGB", (width_px, plan.height + _HEAD_PX + _FOOT_PX), PAPER)
    corner_px = ((page.width - plan.width) // 2, _HEAD_PX)
    page.paste(plan, corner_px)
    draw = ImageDraw.Draw(page)
    _write_areas(draw, view, corner_px)
    _write_head(draw, view)
    _draw_scale(draw, view, page.width - _PAD_PX)
    _draw_legend(draw, page.height - _FOOT_PX + 20, view)
    return np.asarray(page)


def save_picture(scene: Scene, path: str | Path) -> None:
    """Draw the selected storey of a scene into a picture file; see `draw_storey`.

    Raises:
        ValueError: If the suffix of `path` names no picture format.
    """
    Image.fromarray(draw_storey(scene)).save(path)


def _write_areas(draw: ImageDraw.ImageDraw, view: TopDown, corner_px: tuple[int, int]) -> None:
    """Write the area of each larger part where it is widest."""
    for part in (1, *view.cut_off_parts):
        depth_m = ndimage.distance_transform_edt(view.grid.component == part) * view.grid.frame.cell_m
        if depth_m.max() >= _LABELLED_DEPTH_M:
            widest = np.array(np.unravel_index(int(depth_m.argmax()), depth_m.shape))
            right, down = view.pixel_of(view.grid.frame.centers_of(widest)[0])
            center_px = (corner_px[0] + right, corner_px[1] + down)
            _write_square_metres(
                draw, center_px, view.grid.component_areas_m2[part - 1], 20 if part == 1 else 15
            )


def _write_square_metres(
    draw: ImageDraw.ImageDraw, center_px: tuple[float, float], area_m2: float, size_px: int
) -> None:
    """Write an area around a point, with the exponent as a small raised digit: the font has none."""
    text, large, small = f"{area_m2:.1f} m", _font(size_px), _font(round(0.65 * size_px))
    length_px = draw.textlength(text, large)
    left = center_px[0] - 0.5 * (length_px + draw.textlength("2", small))
    draw.text((left, center_px[1]), text, _INK, large, anchor="lm")
    draw.text((left + length_px + 1, center_px[1] - 0.3 * size_px), "2", _INK, small, anchor="lm")


def _write_head(draw: ImageDraw.ImageDraw, view: TopDown) -> None:
    scene = view.scene
    ceiling = "no ceiling" if scene.ceiling_y_m is None else f"ceiling {scene.ceiling_y_m:.2f} m"
    facts = (
        f"storey {scene.storey.index} of 0 to {len(scene.storeys) - 1}"
        if len(scene.storeys) > 1
        else "one storey",
        f"floor {scene.floor_y_m:.2f} m",
        ceiling,
        f"{len(scene.mesh.faces):,} triangles",
        f"body of {view.grid.body.radius_m:.2f} m radius",
    )
    draw.text((_PAD_PX, 22), scene.name, _INK, _font(26))
    draw.text((_PAD_PX, 56), "   ·   ".join(facts), _FADED, _font(15))


def _draw_legend(draw: ImageDraw.ImageDraw, top: int, view: TopDown) -> None:
    entries: list[tuple[str, tuple[Color, ...]]] = [("reachable", (REACHABLE,))]
    if view.cut_off_parts:
        entries.append(("cut off", CUT_OFF[: len(view.cut_off_parts)]))
    entries += [
        ("too narrow", (FLOOR,)),
        ("obstacles, low to high", tuple(color for _, _, color in OBSTACLES)),
        ("walls", (WALL,)),
    ]
    x = float(_PAD_PX)
    for name, colors in entries:
        for color in colors:
            draw.rounded_rectangle((x, top, x + 18, top + 18), 3, color, outline=(205, 202, 194))
            x += 22
        draw.text((x + 4, top + 9), name, _INK, _font(15), anchor="lm")
        x += 30 + draw.textlength(name, _font(15))


def _draw_scale(draw: ImageDraw.ImageDraw, view: TopDown, right: int) -> None:
    """Draw a scale bar of a round length, in two halves, that ends at `right`."""
    longest_m = 200.0 / view.px_per_m
    length_m = max((scale for scale in _SCALES_M if scale <= longest_m), default=_SCALES_M[0])
    length_px, y = length_m * view.px_per_m, 62
    left, middle = right - length_px, right - 0.5 * length_px
    draw.rectangle((left, y, middle, y + 6), _INK)
    draw.rectangle((middle, y, right, y + 6), PAPER, outline=_INK)
    for x, value, anchor in (
        (left, "0", "lb"),
        (middle, f"{0.5 * length_m:g}", "mb"),
        (right, f"{length_m:g} m", "rb"),
    ):
        draw.text((x, y - 5), value, _INK, _font(14), anchor=anchor)


def _font(size_px: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size_px)
