import numpy as np
import pytest
import trimesh

from anm_gym.mesh import TriangleMesh
from anm_gym.metrics.distance import MeshDistance
from anm_gym.metrics.map_accuracy import field_scores, reconstruction_scores, sampling_floor_pct


def box_sdf(points, shift_m=0.0):
    inside = np.stack(
        [2.0 - np.abs(points[:, 0]), 2.0 - np.abs(points[:, 2]), points[:, 1], 2.5 - points[:, 1]]
    )
    return inside.min(axis=0) + shift_m


def sphere(radius_m):
    ball = trimesh.creation.icosphere(subdivisions=5, radius=radius_m)
    return TriangleMesh(np.array(ball.vertices), np.array(ball.faces, np.int32))


def test_the_true_distance_has_no_error(box_room):
    scores = field_scores(box_sdf, box_room(4.0, 4.0, 2.5), num_samples=2000)
    assert scores.mad_cm == pytest.approx(0.0, abs=1e-4)
    assert scores.mad_official_cm == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("shift_m", [0.03, -0.07])
def test_a_shifted_distance_has_the_shift_as_its_error(box_room, shift_m):
    room = box_room(4.0, 4.0, 2.5)
    scores = field_scores(lambda points: box_sdf(points, shift_m), room, num_samples=2000)
    assert scores.mad_cm == pytest.approx(100 * abs(shift_m), abs=1e-4)
    assert scores.mad_official_cm == pytest.approx(100 * abs(shift_m), abs=1e-4)


def test_the_official_error_leaves_out_the_ceiling(box_room):
    def wrong_above(points):
        return np.where(points[:, 1] > 1.7, 1.0, 0.0)

    scores = field_scores(wrong_above, box_room(4.0, 4.0, 2.5), num_samples=2000)
    assert scores.mad_official_cm == 0.0
    assert scores.mad_cm > 20.0


@pytest.mark.parametrize(("offset_m", "fpr_pct"), [(0.03, 0.0), (0.06, 100.0)])
def test_a_larger_sphere_is_inaccurate_by_its_offset(rng, offset_m, fpr_pct):
    guess = sphere(1.0 + offset_m)
    scores = reconstruction_scores(guess.vertices, guess.faces, sphere(1.0), rng, num_samples=20_000)
    assert scores.acc_cm == pytest.approx(100 * offset_m, abs=0.05)
    assert scores.fpr_pct == fpr_pct
    assert scores.fpr_official_pct >= scores.fpr_pct


def test_a_perfect_mesh_has_the_sampling_floor_officially_and_none_natively(box_room, rng):
    room = box_room(6.0, 6.0, 2.5)
    scores = reconstruction_scores(
        room.vertices, room.faces, room, rng, num_samples=20_000, true_distance=MeshDistance(room)
    )
    assert (scores.acc_cm, scores.fpr_pct) == (pytest.approx(0.0, abs=1e-9), 0.0)
    assert scores.fpr_official_pct == pytest.approx(scores.fpr_floor_pct, abs=0.8)
    assert 25.0 < scores.fpr_floor_pct < 35.0


@pytest.mark.parametrize("faces", [np.zeros((0, 3), int), np.zeros((1, 3), int)])
def test_a_reconstruction_without_area_has_no_scores(faces, box_room, rng):
    scores = reconstruction_scores(np.zeros((len(faces), 3)), faces, box_room(), rng, num_samples=100)
    assert np.isnan([scores.acc_cm, scores.fpr_pct, scores.fpr_official_pct]).all()


@pytest.mark.parametrize(("area_m2", "floor_pct"), [(400.0, 2.0), (1000.0, 20.8), (2000.0, 45.6)])
def test_the_sampling_floor_has_its_closed_form(area_m2, floor_pct):
    assert sampling_floor_pct(200_000, area_m2) == pytest.approx(floor_pct, abs=0.05)
