"""The picture of a learning curve."""

import numpy as np
from PIL import Image

from train.learning_curve import learning_curve_figure


def draw(path, values, baselines) -> np.ndarray:
    steps = [1000 * index for index in range(len(values))]
    learning_curve_figure(steps, values, baselines, "seen (%)", path)
    return np.asarray(Image.open(path).convert("RGB"), np.int64)


def test_curve_rises_through_the_picture(tmp_path):
    picture = draw(tmp_path / "curve.png", [[10, 12, 14], [50, 52, 54], [90, 92, 94]], {})
    is_blue = np.abs(picture - np.array([0, 114, 178])).sum(axis=2) < 30
    rows = np.array([np.flatnonzero(column).mean() for column in is_blue.T[150:800] if column.any()])
    assert len(rows) > 300
    assert rows[-50:].mean() < 0.5 * rows[:50].mean()


def test_each_baseline_has_its_line(tmp_path):
    bare = draw(tmp_path / "bare.png", [[10, 20, 30]] * 2, {})
    named = draw(tmp_path / "named.png", [[10, 20, 30]] * 2, {"random": 60.0})
    is_red = [np.abs(picture - np.array([213, 94, 0])).sum(axis=2) < 30 for picture in (bare, named)]
    assert not is_red[0].any()
    assert is_red[1].sum() > 500
