"""Rows of a map that was learned from a few frames of a box."""

from dataclasses import replace

import numpy as np
import pytest

from anm_gym.map.presets import map_settings
from anm_gym.map.settings import ScheduleSettings
from benchmarks.learning import Learned, LearningCost, learn
from benchmarks.quality import Effort, make_truth, score_map

EFFORT = Effort(surface=2000, free_per_frame=50, crossings=200, reconstruction=1000)
KEYS = {
    *("preset", "field", "settings_hash", "steps", "iterations", "points_step", "family", "crossings"),
    *("cpu_ms_step", "observe_ms_step", "wall_ms_step", "flops_step", "memory_mb", "variability_ms"),
    *("mad_seen_cm", "mad_all_cm", "free_err_cm", "sign_err_pct", "fpr_pct", "acc_cm"),
    *("auroc_seen", "auroc_far", "auroc_false", "ause"),
}


@pytest.fixture(scope="module")
def truth(recording):
    return make_truth(recording, EFFORT)


@pytest.fixture
def learned(recording, tiny):
    return learn(recording, tiny)


def test_truth_is_taken_from_the_frames(recording, truth):
    assert truth.probes.free.shape == (200, 3)
    assert truth.probes.free_m.min() > 0.02
    assert 0.1 < truth.probes.is_seen.mean() < 0.5  # coarse pixels leave gaps of more than 2 cm
    assert truth.observed.distance_of(truth.probes.surface[truth.probes.is_seen]).max() < 0.02
    assert truth.distance.distance_m(truth.observed.points).max() < 1e-3


def test_every_family_has_a_row_about_the_same_map(learned, truth):
    rows = score_map(learned, truth, ["unit_norm", "laplace"], EFFORT)
    assert [row["family"] for row in rows] == ["unit_norm", "laplace"]
    assert all(set(row) == KEYS for row in rows)
    assert rows[0]["mad_seen_cm"] == rows[1]["mad_seen_cm"] > 0.0
    assert rows[0]["variability_ms"] > 0.0
    assert rows[0]["points_step"] == 5 * 40 * 27 * learned.cost.iterations / 4


def test_a_family_that_the_field_does_not_allow_is_left_out(learned, truth):
    rows = score_map(learned, truth, ["dropout", "laplace"], EFFORT)
    assert [row["family"] for row in rows] == ["laplace"]


def test_any_other_error_of_a_family_is_not_hidden(learned, truth):
    def broken(points):
        raise ValueError("`points` must be finite")

    learned.neural_map.variability = broken
    with pytest.raises(ValueError, match="`points` must be finite"):
        score_map(learned, truth, ["laplace"], EFFORT)


def test_scoring_leaves_the_settings_as_they_were(learned, truth, tiny):
    score_map(learned, truth, ["laplace", "unit_norm"], EFFORT)
    assert learned.neural_map.settings == tiny


class FlatMap:
    """Predicts 1 m everywhere and nothing else."""

    def __init__(self, neural_map):
        self._neural_map = neural_map

    def __getattr__(self, name):
        return getattr(self._neural_map, name)

    def sdf(self, points):
        return np.ones(len(points), np.float32)

    def mesh(self):
        from anm_gym.map.zero_crossings import EMPTY

        return EMPTY


def test_a_map_without_a_surface_has_no_ranking(learned, truth):
    cost = LearningCost(4, 39, 1.0, 1.0, 1.0, 1.0)
    (row,) = score_map(Learned(FlatMap(learned.neural_map), cost), truth, ["delta_weight"], EFFORT)
    assert row["mad_seen_cm"] == pytest.approx(100.0)
    assert row["crossings"] == 0
    assert np.isnan([row["fpr_pct"], row["auroc_seen"], row["ause"], row["variability_ms"]]).all()


def test_points_of_a_field_with_grids_include_those_that_fill_in(recording, truth):
    settings = replace(map_settings("fast"), schedule=ScheduleSettings(first_iterations=4, iterations=1))
    learned = learn(recording, settings)
    row = score_map(learned, truth, ["laplace"], EFFORT)[0]
    assert row["points_step"] == 8 * 30 * 10 * learned.cost.iterations / 4 + 300 * 6
    assert row["mad_seen_cm"] < 5.0
    assert np.isnan(row["flops_step"])
