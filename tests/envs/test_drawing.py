"""Drawing: metres end up at the right pixels, colours are in order."""

from collections.abc import Callable

import numpy as np
import pytest

from anm_gym.envs.drawing import Canvas, depth_colors, time_colors

RED, GREEN, BLACK = (255, 0, 0), (0, 255, 0), (0, 0, 0)


@pytest.fixture
def canvas() -> Canvas:
    """Give a black canvas of 4 x 2 m, 20 pixels to a metre, with its corner at (-1, 2)."""
    return Canvas(np.zeros((40, 80, 3), np.uint8), (-1.0, 2.0), 20.0)


def center_px(canvas: Canvas, color: tuple[int, int, int]) -> np.ndarray:
    """Mean (right, down) of the pixels of a colour, their centres at +0.5."""
    return np.argwhere((canvas.image == color).all(axis=2))[:, ::-1].mean(axis=0) + 0.5


def test_pixels_count_from_the_corner(canvas: Canvas) -> None:
    np.testing.assert_allclose(canvas.pixels_of([[-1.0, 2.0], [3.0, 4.0]]), [[0, 0], [80, 40]])


@pytest.mark.parametrize("draw", [Canvas.disc, Canvas.pin])
def test_marker_is_drawn_at_its_point(canvas: Canvas, draw: Callable[..., None]) -> None:
    draw(canvas, (1.0, 3.0), 6.0, RED)
    column, row = center_px(canvas, RED)
    assert column == pytest.approx(40.0, abs=0.6)
    assert 8.0 < row <= 20.5


def test_path_joins_its_points_in_the_colours_of_its_pieces(canvas: Canvas) -> None:
    canvas.path([[0.0, 3.0], [1.0, 3.0], [2.0, 3.0]], np.array([RED, GREEN], np.uint8))
    assert canvas.image[20, 30].tolist() == list(RED)
    assert canvas.image[20, 50].tolist() == list(GREEN)
    assert canvas.image[5].max() == 0


def test_path_of_one_point_draws_nothing(canvas: Canvas) -> None:
    canvas.path([[0.0, 3.0]], time_colors(0))
    assert canvas.image.max() == 0


@pytest.mark.parametrize(
    ("heading_rad", "towards"), [(0.0, (0, -1)), (np.pi / 2, (-1, 0)), (-np.pi / 2, (1, 0)), (np.pi, (0, 1))]
)
def test_agent_points_along_its_heading(canvas: Canvas, heading_rad: float, towards: tuple[int, int]) -> None:
    canvas.agent((1.0, 3.0), heading_rad, RED, size_px=10.0)
    tip = np.array([40.0, 20.0]) + 6.0 * np.array(towards)
    tail = np.array([40.0, 20.0]) - 8.0 * np.array(towards)
    assert canvas.image[int(tip[1]), int(tip[0])].tolist() == list(RED)
    assert canvas.image[int(tail[1]), int(tail[0])].tolist() != list(RED)


def test_area_lets_the_floor_shine_through(canvas: Canvas) -> None:
    canvas.area([[0.0, 2.5], [1.0, 2.5], [1.0, 3.5], [0.0, 3.5]], (200, 100, 0), opacity=0.5)
    assert canvas.image[20, 30].tolist() == [100, 50, 0]


def test_drawing_outside_is_cut_off(canvas: Canvas) -> None:
    canvas.disc((50.0, 50.0), 5.0, RED)
    canvas.agent((-9.0, 2.0), 0.0, RED)
    assert canvas.image.max() == 0


def test_near_depth_is_brighter_than_far_and_empty_is_black() -> None:
    colors = depth_colors(np.array([[0.5, 2.0, 5.0, 10.0, 0.0]], np.float32), 10.0)
    brightness = colors[0].astype(int).sum(axis=1)
    assert (np.diff(brightness) < 0).all()
    assert colors[0, 4].tolist() == list(BLACK)


def test_time_goes_from_dark_to_bright() -> None:
    colors = time_colors(50)
    assert colors.shape == (50, 3)
    assert colors[0].astype(int).sum() < colors[-1].astype(int).sum()
