"""Seen surface, free space and zero-crossings of a room whose distance is known."""

import numpy as np
import pytest

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.metrics.depth_view import depth_view
from anm_gym.metrics.distance import MeshDistance
from anm_gym.metrics.map_quality import (
    Crossings,
    Probes,
    free_space_points,
    label_crossings,
    make_probes,
    map_quality,
    rank_crossings,
)
from anm_gym.sim.backends import make_depth_camera

CAMERA = CameraSpec(48, 48)


def box_sdf(points):
    """Exact distance inside the room of 4 x 2.5 x 4 m."""
    return (np.array([2.0, 1.25, 2.0]) - np.abs(points - np.array([0.0, 1.25, 0.0]))).min(axis=1)


@pytest.fixture(scope="module")
def view(box_room):
    """The room seen from its middle, looking along -z."""
    pose = camera_pose((0.0, 1.25, 0.0), 0.0)
    return depth_view(make_depth_camera(box_room(), CAMERA).render(pose), CAMERA, pose)


@pytest.fixture(scope="module")
def probes(box_room, view):
    """Probes of a frame that has shown everything in front of z = 0."""
    room = box_room()
    return make_probes(
        room,
        free_space_points(view, 500, np.random.default_rng(0)),
        lambda points: np.maximum(points[:, 2], 0.0),
        MeshDistance(room).distance_m,
        seen_m=0.02,
        num_surface=4000,
    )


def test_free_points_lie_on_rays_before_the_surface(view, rng):
    points = free_space_points(view, 2000, rng)
    depth_m = -points[:, 2]
    assert points.shape == (2000, 3)
    assert depth_m.min() >= 0.07 - 1e-6
    assert np.abs(points[:, 0]).max() < depth_m.max() + 1e-6
    # A point 0.1 m of depth before a wall keeps at least 0.1 m * 1.25 / 2 from it, as rays are that steep.
    assert box_sdf(points).min() > 0.05


def test_free_points_are_uniform_in_depth(rng):
    wall = depth_view(np.full((48, 48), 4.1, np.float32), CAMERA, np.eye(4))
    depth_m = -free_space_points(wall, 20_000, rng)[:, 2]
    np.testing.assert_allclose(np.quantile(depth_m, [0.25, 0.5, 0.75]), [1.05, 2.03, 3.02], atol=0.05)


def test_the_same_seed_draws_the_same_free_points(view):
    first, second = (free_space_points(view, 50, np.random.default_rng(4)) for _ in range(2))
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("depth_m", [0.0, 0.15, 9.0])
def test_a_frame_that_shows_no_free_space_gives_no_points(depth_m, rng):
    blind = depth_view(np.full((48, 48), depth_m, np.float32), CAMERA, np.eye(4))
    assert free_space_points(blind, 10, rng).shape == (0, 3)


def test_probes_know_what_was_seen(probes):
    np.testing.assert_array_equal(probes.is_seen, probes.surface[:, 2] < 0.02)
    np.testing.assert_allclose(probes.free_m, box_sdf(probes.free), atol=1e-6)


def test_the_true_distance_has_no_error(probes):
    quality = map_quality(box_sdf, probes)
    assert quality.mad_seen_cm == pytest.approx(0.0, abs=1e-4)
    assert quality.mad_all_cm == pytest.approx(0.0, abs=1e-4)
    assert quality.free_err_cm == pytest.approx(0.0, abs=1e-4)
    assert quality.sign_err_pct == 0.0


def test_an_error_where_nothing_was_seen_spares_the_seen_surface(probes):
    quality = map_quality(lambda p: box_sdf(p) + np.where(p[:, 2] > 0.02, 0.4, 0.03), probes)
    assert quality.mad_seen_cm == pytest.approx(3.0, abs=1e-3)
    share = 1.0 - probes.is_seen.mean()
    assert quality.mad_all_cm == pytest.approx(40.0 * share + 3.0 * (1.0 - share), abs=0.1)
    assert quality.free_err_cm == pytest.approx(3.0, abs=1e-3)


def test_solid_free_space_is_a_wrong_sign(probes):
    quality = map_quality(lambda points: np.where(points[:, 0] > 0.0, 1.0, -1.0), probes)
    assert quality.sign_err_pct == pytest.approx(100.0 * (probes.free[:, 0] <= 0.0).mean())


def test_no_probe_makes_no_number():
    nothing = np.zeros((0, 3))
    quality = map_quality(
        box_sdf, Probes(nothing, np.zeros(0, bool), nothing.astype(np.float32), np.zeros(0))
    )
    assert np.isnan(
        [quality.mad_seen_cm, quality.mad_all_cm, quality.free_err_cm, quality.sign_err_pct]
    ).all()


def test_crossings_carry_both_distances(box_room):
    vertices = np.array([[1.9, 1.0, 0.0], [0.0, 1.0, 0.5]], np.float32)
    crossings = label_crossings(vertices, lambda p: p[:, 0], MeshDistance(box_room()).distance_m)
    np.testing.assert_allclose(crossings.observed_m, [1.9, 0.0], atol=1e-6)
    np.testing.assert_allclose(crossings.true_m, [0.1, 1.0], atol=1e-6)


def test_no_crossings_have_no_ranking():
    crossings = label_crossings(np.zeros((0, 3), np.float32), box_sdf, box_sdf)
    scores = rank_crossings(crossings, [])
    assert len(crossings) == 0
    assert np.isnan([scores.auroc_seen, scores.auroc_far, scores.auroc_false, scores.ause]).all()


def make_crossings(observed_m, true_m):
    return Crossings(np.zeros((len(true_m), 3), np.float32), np.array(observed_m), np.array(true_m))


def test_ranking_leaves_out_what_is_neither_seen_nor_unseen():
    crossings = make_crossings([0.01, 0.05, 0.07, 0.2, 0.4], [0.0, 0.0, 0.0, 0.0, 0.2])
    scores = rank_crossings(crossings, [1.0, 2.0, 99.0, 1.5, 3.0])
    assert scores.auroc_seen == 0.75  # 0.2 beats one of the two seen ones, 0.4 both
    assert scores.auroc_far == 1.0
    assert scores.auroc_false == 0.75  # the one false crossing scores above three of four true ones


def test_a_coarser_cloud_may_call_more_of_it_seen():
    crossings = make_crossings([0.055, 0.2], [0.0, 0.0])
    assert np.isnan(rank_crossings(crossings, [0.0, 1.0]).auroc_seen)
    assert rank_crossings(crossings, [0.0, 1.0], seen_m=0.06).auroc_seen == 1.0


def test_a_score_that_is_the_error_sorts_perfectly(rng):
    true_m = rng.uniform(0.0, 0.5, 200)
    scores = rank_crossings(make_crossings(true_m, true_m), true_m)
    assert (scores.auroc_seen, scores.auroc_far, scores.auroc_false, scores.ause) == (1.0, 1.0, 1.0, 0.0)
