import numpy as np
import pytest

from anm_gym.metrics.curves import auc, auc_over_metres, auc_over_steps, path_length_m


def test_a_constant_curve_has_its_value_as_its_mean():
    assert auc_over_steps(np.full(11, 40.0), 10) == pytest.approx(40.0)


def test_a_short_curve_is_held_at_its_last_value():
    assert auc_over_steps([0.0, 100.0], 10) == pytest.approx(90.0)


def test_a_long_curve_is_cut_at_the_budget():
    assert auc_over_steps([50.0, 50.0, 100.0, 100.0], 2) == pytest.approx(50.0)


def test_a_linear_curve_has_half_of_its_end():
    assert auc(np.arange(1001), np.arange(1001) / 10.0, 1000) == pytest.approx(50.0, abs=0.1)


def test_without_a_budget_the_last_x_ends_the_axis():
    assert auc([0.0, 2.0, 4.0], [1.0, 3.0, 99.0]) == pytest.approx(2.0)


def test_what_turning_in_place_showed_counts_from_the_same_metre():
    assert auc_over_metres([0.0, 10.0, 20.0], [0.0, 0.0, 1.0], 2.0) == pytest.approx(15.0)


def test_path_length_adds_up_and_ignores_turns():
    path = [[0.0, 0.0], [3.0, 4.0], [3.0, 4.0], [3.0, 5.0]]
    assert path_length_m(path).tolist() == [0.0, 5.0, 5.0, 6.0]


@pytest.mark.parametrize(
    ("x", "y", "budget", "message"),
    [
        ([], [], 1, "equally long and not empty"),
        ([0, 1], [1.0], 1, "equally long and not empty"),
        ([1, 0], [1.0, 2.0], 1, "not descend"),
        ([-1, 0], [1.0, 2.0], 1, "0 or more"),
        ([0, 1], [1.0, 2.0], 0, "`budget` must be > 0"),
    ],
)
def test_bad_curves_are_refused(x, y, budget, message):
    with pytest.raises(ValueError, match=message):
        auc(x, y, budget)


def test_a_path_of_another_shape_is_refused():
    with pytest.raises(ValueError, match=r"`positions_xz` must have shape \(T, 2\)"):
        path_length_m(np.zeros((3, 3)))
