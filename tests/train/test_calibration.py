"""The calibration of maps whose errors are known."""

import numpy as np
import pytest

from anm_gym.geometry import CameraSpec
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.presets import map_settings
from anm_gym.metrics.distance import MeshDistance
from train.calibration import calibration_scores, considered_crossings, predicted_std_m, views_of


@pytest.fixture(autouse=True)
def few_points(monkeypatch):
    """Ask at fewer points, to be quick."""
    monkeypatch.setattr("train.calibration.NUM_FREE", 600)


def scores_of(neural_map):
    return calibration_scores(neural_map, neural_map.room, MeshDistance(neural_map.room))


def wrong_behind(points):
    """Errs by 20 cm behind the camera, where nothing was seen, and by little in front of it."""
    return np.where(points[:, 2] > 0.5, 0.2, 0.001 * np.abs(points[:, 2]))


def test_an_exact_map_errs_nowhere(known_map):
    row = scores_of(known_map())
    assert row["mad_seen_cm"] == pytest.approx(0.0, abs=1e-4)
    assert row["free_err_cm"] == pytest.approx(0.0, abs=1e-4)
    assert row["sign_err_pct"] == 0.0
    assert np.isnan(row["auroc_false"])
    assert all(rms_m < 0.02 for _, rms_m, _ in row["reliability"])


def test_an_error_in_unseen_space_is_no_error_where_it_has_seen(known_map):
    row = scores_of(known_map(wrong_behind))
    assert row["mad_seen_cm"] < 0.3
    assert row["free_err_cm"] < 0.3


def test_variability_that_knows_the_error_sorts_by_it(known_map):
    row = scores_of(known_map(wrong_behind))
    assert row["auroc_false"] > 0.99
    assert row["ause"] < 0.1
    std_m, rms_m, count = np.array(row["reliability"]).T
    assert std_m[-1] == pytest.approx(0.2, abs=0.01)
    assert rms_m[-1] == pytest.approx(0.2, abs=0.02)
    assert count.sum() <= 2000


def test_variability_that_knows_what_was_seen_tells_it_from_unseen_surface(known_map):
    neural_map = known_map()
    neural_map.variability = neural_map.cloud.distance_of
    assert scores_of(neural_map)["auroc_seen"] == 1.0


def test_a_map_that_takes_free_space_for_solid_has_the_wrong_sign(known_map):
    row = scores_of(known_map(lambda points: np.full(len(points), -9.0)))
    assert row["sign_err_pct"] == 100.0
    assert row["free_err_cm"] == pytest.approx(900.0)
    assert row["reliability"] == []


def test_a_map_that_has_seen_nothing_has_no_calibration(box_room):
    neural_map = NeuralMap(map_settings("fast"), CameraSpec(8, 8))
    assert calibration_scores(neural_map, box_room(), MeshDistance(box_room())) == {}


def test_kept_frames_come_back_as_they_were_seen(known_map):
    neural_map = known_map()
    views = list(views_of(neural_map))
    assert len(views) == 3
    assert MeshDistance(neural_map.room).distance_m(views[1].points).max() < 1e-3


def test_considered_crossings_lie_on_the_surface_around_what_was_seen(known_map, rng):
    neural_map = known_map()
    vertices = considered_crossings(neural_map, 0.1, 10_000, rng)
    assert np.abs(neural_map.sdf(vertices)).max() < 0.06
    assert vertices[:, 2].min() < -1.4  # the wall ahead
    assert (neural_map.cloud.distance_of(vertices) > 0.3).any()  # and some that nobody has seen


def test_no_crossing_is_made_up_where_the_map_is_not_asked(known_map, rng):
    solid = known_map(lambda points: np.full(len(points), -9.0))
    assert len(considered_crossings(solid, 0.2, 100, rng)) == 0


def test_many_crossings_are_thinned_out_repeatably(known_map):
    neural_map = known_map()
    first, second = (considered_crossings(neural_map, 0.2, 50, np.random.default_rng(1)) for _ in range(2))
    assert first.shape == (50, 3)
    np.testing.assert_array_equal(first, second)


def test_both_statistics_of_a_gaussian_are_its_standard_deviation(rng):
    changes = 0.3 * rng.standard_normal((100_000, 1))
    for statistic, score in (
        ("variance", changes.var(axis=0)),
        ("mean_absolute", np.abs(changes).mean(axis=0)),
    ):
        assert predicted_std_m(score, statistic)[0] == pytest.approx(0.3, rel=0.02)
