"""Curves: their values between points, bands, and that a picture comes out."""

import math

import numpy as np
import pytest

from train.plots import (
    Curve,
    completion_figure,
    figure,
    has_band,
    mean_band,
    plot_curves,
    reliability_figure,
    spread_labels,
    tradeoff_figure,
)
from train.tables.reliability import ReliabilityBin


def test_curve_is_straight_between_points_and_held_after_its_end():
    curve = Curve(np.array([0.0, 1.0, 1.0, 2.0]), np.array([0.0, 5.0, 6.0, 9.0]))
    np.testing.assert_allclose(curve.at([-1.0, 0.5, 1.0, 1.5, 2.0, 50.0]), [0.0, 3.0, 6.0, 7.5, 9.0, 9.0])


def test_coarse_curve_does_not_lag_behind_a_fine_one():
    fine = Curve(np.arange(101.0), np.arange(101.0))
    coarse = Curve(np.arange(0.0, 101.0, 20.0), np.arange(0.0, 101.0, 20.0))
    np.testing.assert_allclose(coarse.at(np.arange(101.0)), fine.at(np.arange(101.0)))


def test_labels_keep_apart_and_within_the_axes():
    assert spread_labels([1.0, 1.5, 8.0], 1.0, 10.0) == [1.0, 2.0, 8.0]
    assert spread_labels([8.0, 9.5, 9.6, 9.7], 1.0, 10.0) == [7.0, 8.0, 9.0, 10.0]
    assert spread_labels([], 1.0, 10.0) == []


def test_band_of_two_curves_matches_the_t_distribution():
    x = np.array([0.0, 1.0])
    band = mean_band([Curve(x, np.array([0.0, 4.0])), Curve(x, np.array([2.0, 4.0]))], x)
    np.testing.assert_array_equal(band.mean, [1.0, 4.0])
    np.testing.assert_allclose(band.high - band.mean, [12.706204736432095, 0.0])
    np.testing.assert_allclose(band.low + band.high, 2.0 * band.mean)


def test_single_curve_has_no_band():
    x = np.array([0.0, 1.0])
    assert np.isnan(mean_band([Curve(x, x)], x).low).all()


def test_two_scenes_have_no_band_however_many_starts_there_are():
    x = np.array([0.0, 1.0])
    assert has_band([Curve(x, x, "a")] * 3)
    assert not has_band([Curve(x, x, scene) for scene in "aabb"])
    assert has_band([Curve(x, x, scene) for scene in "abc"])


def test_figure_is_drawn_without_a_display(tmp_path):
    x = np.linspace(0.0, 10.0, 11)
    curves = {"fbe": [Curve(x, 5.0 * x), Curve(x, 6.0 * x)], "anm:best": [Curve(x, 6.1 * x)]}
    path = completion_figure(curves, curves, 10, tmp_path / "sub" / "curves.png")
    assert path.read_bytes().startswith(b"\x89PNG")


def test_names_at_the_ends_of_equal_curves_do_not_overlap():
    _, (axes, _) = figure(2)
    x = np.linspace(0.0, 10.0, 11)
    plot_curves(axes, {name: [Curve(x, 5.0 * x)] for name in "abc"}, 10.0, "steps", "y")
    heights = sorted(text.xyann[1] for text in axes.texts)
    assert np.diff(heights).min() > 0.05 * axes.get_ylim()[1]
    assert not math.isnan(heights[0])


@pytest.mark.parametrize("num_agents", [1, 9])
def test_any_number_of_agents_gets_colours(tmp_path, num_agents):
    x = np.array([0.0, 1.0])
    curves = {f"agent{i}": [Curve(x, x)] for i in range(num_agents)}
    assert completion_figure(curves, curves, 1, tmp_path / "curves.png").exists()


def test_curves_are_drawn_whole_and_begin_where_they_begin():
    _, [axes] = figure(1)
    curve = Curve(np.array([20.0, 100.0]), np.array([150.0, 220.0]))
    plot_curves(axes, {"a": [curve]}, 100.0, "steps", "error (cm)", y_max=np.inf)
    assert axes.get_ylim()[1] > 220.0
    assert axes.get_lines()[0].get_xdata()[0] == 20.0


def test_curves_of_one_colour_differ_in_strokes():
    _, [axes] = figure(1)
    x = np.array([0.0, 10.0])
    plot_curves(axes, {f"agent{i}": [Curve(x, x)] for i in range(15)}, 10.0, "steps", "y")
    looks = {(line.get_color(), line.get_linestyle()) for line in axes.get_lines()}
    assert len(looks) == 15
    labels = [text.get_text() for text in axes.texts]
    assert len(set(labels)) == 15
    assert sum(label.startswith("– – ") for label in labels) == 7


def test_reliability_is_drawn_even_where_no_error_was_made(tmp_path):
    curves = {
        "anm:best": [ReliabilityBin(0.01, 0.02, 50.0, 1.5, 2.5), ReliabilityBin(0.1, 0.2, 50.0, 2.0, 2.0)],
        "anm:paper": [ReliabilityBin(0.01, 0.0, 100.0, 0.0, 0.0)],
    }
    path = reliability_figure(curves, tmp_path / "sub" / "reliability.png")
    assert path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("costs", [[100.0], [100.0, 101.0], [1.0, 10_000.0]])
def test_trade_offs_are_drawn_whatever_the_costs(tmp_path, costs):
    points = {f"map{index}": {"ms": cost, "cm": 2.0, "pct": 5.0} for index, cost in enumerate(costs)}
    measures = [("cm", "error (cm)"), ("pct", "false (%)")]
    path = tradeoff_figure(points, ("ms", "CPU (ms)"), measures, tmp_path / "trade.png")
    assert path.read_bytes().startswith(b"\x89PNG")
