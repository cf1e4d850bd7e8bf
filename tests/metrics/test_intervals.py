import numpy as np
import pytest

from anm_gym.metrics.intervals import mean_interval, paired_difference, wilson_interval


def test_the_interval_is_students():
    interval = mean_interval([1.0, 2.0, 3.0, 4.0])
    assert interval.mean == 2.5
    assert interval.half_width == pytest.approx(3.18245 * np.std([1, 2, 3, 4], ddof=1) / 2, rel=1e-5)
    assert (interval.low + interval.high) / 2 == pytest.approx(2.5)


def test_it_holds_the_mean_as_often_as_it_says(rng):
    draws = [mean_interval(rng.normal(5.0, 2.0, 6)) for _ in range(2000)]
    hits = [interval.low <= 5.0 <= interval.high for interval in draws]
    assert np.mean(hits) == pytest.approx(0.95, abs=0.02)


def test_one_value_has_a_mean_but_no_interval():
    interval = mean_interval([3.0])
    assert (interval.mean, interval.count) == (3.0, 1)
    assert np.isnan(interval.half_width)


def test_values_that_are_missing_are_left_out():
    assert mean_interval([1.0, np.nan, 3.0, np.inf]).mean == 2.0
    empty = mean_interval([])
    assert empty.count == 0
    assert np.isnan(empty.mean)


def test_a_pair_cancels_what_both_share():
    first = {("a", 0): 11.0, ("a", 1): 21.0, ("b", 0): 31.0, ("c", 0): 5.0}
    second = {("a", 0): 10.0, ("a", 1): 20.0, ("b", 0): 30.0}
    interval = paired_difference(first, second)
    assert (interval.mean, interval.half_width, interval.count) == (1.0, 0.0, 3)


def test_pairs_of_one_scene_are_not_counted_as_independent():
    first = {
        (scene, seed): float(value) for scene, value in [("a", 1), ("b", 2), ("c", 3)] for seed in range(20)
    }
    interval = paired_difference(first, dict.fromkeys(first, 0.0))
    assert interval.half_width == pytest.approx(mean_interval([1.0, 2.0, 3.0]).half_width)
    assert interval.count == 60


def test_values_of_a_single_cluster_are_independent():
    values = [1.0, 2.0, 4.0]
    assert mean_interval(values, clusters=["a"] * 3) == mean_interval(values)


@pytest.mark.parametrize("confidence", [0.0, 1.0])
def test_a_confidence_that_is_no_probability_is_refused(confidence):
    with pytest.raises(ValueError, match="`confidence` must be between 0 and 1"):
        mean_interval([1.0, 2.0], confidence)
    with pytest.raises(ValueError, match="`confidence` must be between 0 and 1"):
        wilson_interval(1, 2, confidence)
