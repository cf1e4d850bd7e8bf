"""Reliability over many episodes."""

import math

import pytest

from train.tables.reliability import gather_reliability


def make_row(scene="a", **changes):
    return {"scene": scene, **changes}


def test_bins_are_gathered_by_what_was_predicted_not_by_rank():
    sure = make_row(reliability=[[0.012, 0.012, 10], [0.015, 0.015, 10]])
    unsure = make_row(scene="b", reliability=[[0.1, 0.3, 10], [0.2, 0.6, 10]])
    found = gather_reliability([sure, unsure])
    assert [round(each.ratio, 6) for each in found] == [1.0, 3.0, 3.0]
    assert [each.share_pct for each in found] == [50.0, 25.0, 25.0]


def test_mean_squares_are_weighted_on_both_sides():
    rows = [make_row(reliability=[[0.1, 0.3, 10]]), make_row(reliability=[[0.15, 0.6, 30]])]
    (found,) = gather_reliability(rows)
    assert found.predicted_m == pytest.approx(math.sqrt((0.01 + 3 * 0.0225) / 4))
    assert found.error_m == pytest.approx(math.sqrt((0.09 + 3 * 0.36) / 4))
    assert found.lowest_ratio == found.highest_ratio == pytest.approx(found.ratio)


def test_scenes_that_differ_are_not_averaged_away():
    rows = [
        make_row(scene="a", reliability=[[0.1, 0.05, 9]]),
        make_row(scene="b", reliability=[[0.1, 0.2, 9]]),
    ]
    (found,) = gather_reliability(rows)
    assert (found.lowest_ratio, found.highest_ratio) == (pytest.approx(0.5), pytest.approx(2.0))


def test_rows_without_reliability_have_no_bins():
    assert gather_reliability([make_row(), make_row(reliability=None), make_row(reliability=[])]) == []
