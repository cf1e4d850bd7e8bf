"""Rank statistics in closed form."""

import numpy as np
import pytest

from anm_gym.metrics.ranking import auroc, ause, reliability


def test_separated_classes_are_ranked_perfectly():
    positive = np.arange(10) >= 6
    assert auroc(np.arange(10), positive) == 1.0
    assert auroc(-np.arange(10), positive) == 0.0


def test_a_constant_score_is_chance():
    assert auroc(np.zeros(7), np.arange(7) < 2) == 0.5


def test_ranking_counts_pairs_and_halves_ties(rng):
    scores = rng.integers(0, 6, 60).astype(float)
    positive = rng.random(60) < 0.3
    pairs = scores[positive][:, None] - scores[~positive][None]
    assert auroc(scores, positive) == pytest.approx(((pairs > 0) + 0.5 * (pairs == 0)).mean())


@pytest.mark.parametrize("positive", [np.zeros(3, bool), np.ones(3, bool)])
def test_an_empty_class_has_no_ranking(positive):
    assert np.isnan(auroc(np.arange(3.0), positive))


def test_order_by_the_error_itself_leaves_no_area(rng):
    errors = rng.random(50)
    assert ause(3.0 * errors + 1.0, errors) == 0.0


def test_reversed_order_of_two_points_has_a_closed_form():
    # By score 2 then 0 are left on average 1 and 2, by error 1 and 0; the mean error is 1.
    assert ause([1.0, 0.0], [0.0, 2.0]) == pytest.approx(((1.0 - 1.0) + (2.0 - 0.0)) / 2.0)


def test_a_constant_score_keeps_the_mean_error():
    # Whatever share is left has the mean error 1; by error the means are 1, 1/2 and 0.
    assert ause(np.zeros(3), [0.0, 1.0, 2.0]) == pytest.approx((0.0 + 0.5 + 1.0) / 3.0)


def test_area_does_not_depend_on_the_order_of_ties_or_on_the_unit(rng):
    scores, errors = rng.integers(0, 4, 40).astype(float), rng.random(40)
    shuffled = rng.permutation(40)
    assert ause(scores[shuffled], errors[shuffled]) == pytest.approx(ause(scores, errors))
    assert ause(scores, 100.0 * errors) == pytest.approx(ause(scores, errors))


@pytest.mark.parametrize("errors", [[], [0.0, 0.0]])
def test_nothing_wrong_has_no_area(errors):
    assert np.isnan(ause(np.zeros(len(errors)), errors))


def test_reliability_of_two_levels_is_read_off():
    std, error = [0.3, 0.1, 0.1, 0.3], [0.5, 0.1, -0.1, -0.5]
    result = reliability(std, error, bins=2)
    np.testing.assert_allclose(result.predicted_std_m, [0.1, 0.3])
    np.testing.assert_allclose(result.rms_error_m, [0.1, 0.5])
    np.testing.assert_array_equal(result.counts, [2, 2])


def test_true_standard_deviations_are_reliable(rng):
    std = rng.uniform(0.01, 0.2, 40_000)
    result = reliability(std, std * rng.standard_normal(40_000), bins=8)
    np.testing.assert_allclose(result.rms_error_m, result.predicted_std_m, rtol=0.06)
    assert result.counts.sum() == 40_000


def test_few_points_make_few_bins():
    assert len(reliability([0.1, 0.2], [0.0, 0.0], bins=10).counts) == 2
    assert len(reliability([], []).counts) == 0


def test_unequal_lengths_are_refused():
    with pytest.raises(ValueError, match="`positive` must have one entry per score, got shapes"):
        auroc([1.0], [True, False])
    with pytest.raises(ValueError, match="`errors` must have one entry per score"):
        ause([1.0], [])
    with pytest.raises(ValueError, match="`error_m` must have one entry per score"):
        reliability([1.0], [1.0, 2.0])


def test_no_bins_are_refused():
    with pytest.raises(ValueError, match="`bins` must be >= 1, got 0"):
        reliability([1.0], [1.0], bins=0)


def test_calibrated_deviations_of_any_spread_are_reliable() -> None:
    rng = np.random.default_rng(0)
    std_m = np.exp(rng.standard_normal(200_000))
    found = reliability(std_m, std_m * rng.standard_normal(200_000))
    assert found.rms_error_m / found.predicted_std_m == pytest.approx(1.0, abs=0.1)
