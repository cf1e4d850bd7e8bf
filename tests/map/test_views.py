from dataclasses import replace

import numpy as np
import pytest

from anm_gym.geometry import CameraSpec
from anm_gym.map.views import (
    TakenViews,
    ViewSettings,
    expected_visibility,
    gains_by_heading,
    in_image,
    rank_views,
    sectors_in_view,
    view_costs,
)
from anm_gym.map.volume import OCCUPIED, UNKNOWN, ObservedVolume

SETTINGS = ViewSettings()
CAMERA = CameraSpec()


@pytest.fixture
def volume(tour) -> ObservedVolume:
    log = ObservedVolume(tour.camera)
    for depth, pose in zip(tour.depths, tour.poses, strict=True):
        log.integrate(depth, pose)
    return log


def test_wall_hides_what_is_behind_it(volume: ObservedVolume) -> None:
    place = np.array([[0.0, 1.25, 0.0]])
    points = np.array([[1.9, 1.3, 0.0], [3.0, 1.3, 0.0], [0.0, 1.3, -1.4]], np.float32)
    visibility = expected_visibility(place, points, volume, SETTINGS)
    assert visibility[0].tolist() == [1.0, 0.0, 1.0]


def test_hope_fades_through_unknown_space(volume: ObservedVolume) -> None:
    place = np.array([[50.0, 1.25, 50.0]])
    points = np.array([[51.0, 1.25, 50.0], [53.0, 1.25, 50.0], [60.0, 1.25, 50.0]], np.float32)
    near, far, out_of_range = expected_visibility(place, points, volume, SETTINGS)[0]
    assert 0.0 < far < near < 1.0
    assert out_of_range == 0.0


def test_visibility_is_that_of_samples_along_the_ray(
    volume: ObservedVolume, rng: np.random.Generator
) -> None:
    places = rng.uniform([-1.5, 1.2, -1.0], [1.5, 1.3, 1.0], (6, 3))
    points = rng.uniform([-4.0, 0.0, -4.0], [4.0, 3.0, 4.0], (60, 3)).astype(np.float32)
    visibility = expected_visibility(places, points, volume, SETTINGS)
    for place, row in zip(places, visibility, strict=True):
        for point, value in zip(points, row, strict=True):
            range_m = np.linalg.norm(point - place)
            along = np.arange(
                0.0, max(range_m - SETTINGS.surface_slack_m, SETTINGS.ray_step_m), SETTINGS.ray_step_m
            )
            states = volume.state_at(place + along[:, None] * (point - place) / range_m)
            hope = np.exp(-SETTINGS.ray_step_m * (states == UNKNOWN).sum() / SETTINGS.unknown_decay_m)
            in_range = SETTINGS.min_range_m < range_m < SETTINGS.max_range_m
            assert value == pytest.approx(hope * (in_range and not (states == OCCUPIED).any()), abs=1e-6)
    assert (visibility > 0.0).any()


def test_gain_of_a_heading_is_the_weight_inside_the_image() -> None:
    place = np.zeros((1, 3))
    points = np.array([[0.0, 0.0, -2.0], [-2.0, 0.0, 0.0], [0.5, 3.0, -0.5]], np.float32)
    weights = np.array([1.0, 10.0, 100.0], np.float32)
    gains = gains_by_heading(place, points, weights, np.ones((1, 3), np.float32), CAMERA, SETTINGS)[0]
    ahead, left, behind = gains[0], gains[9], gains[18]
    assert (ahead, left, behind) == (1.0, 10.0, 0.0)
    assert gains.max() < 100.0
    assert gains[3] == 1.0
    assert gains[6] == 10.0


def test_costs_count_steps_and_turns() -> None:
    positions = np.array([[0.0, 0.0], [0.0, -1.3]])
    costs = view_costs(positions, np.array([0.0, 1.3]), np.zeros(2), 0.0, SETTINGS)
    assert costs[0, 0] == 0.0
    assert np.isclose(costs[0, 9], 9.0)
    assert np.isclose(costs[1, 0], 20.0)
    assert np.isclose(costs[1, 18], 38.0)


def test_best_view_has_the_highest_gain_per_step() -> None:
    positions = np.array([[0.0, 0.0], [0.0, -1.0]])
    gains, costs = np.zeros((2, 36)), np.full((2, 36), 10.0)
    gains[0, 3], gains[1, 9] = 5.0, 8.0
    costs[1, 9] = 30.0
    best, utilities = rank_views(positions, gains, costs, SETTINGS)
    assert best.position_xz.tolist() == [0.0, 0.0]
    assert np.isclose(best.heading_rad, np.deg2rad(30.0))
    assert np.isclose(best.utility, utilities.max())


def test_view_that_cannot_be_reached_is_worth_nothing() -> None:
    positions, gains, costs = np.zeros((2, 2)), np.zeros((2, 36)), np.full((2, 36), 3.0)
    gains[0, 0], costs[0] = 5.0, np.inf
    assert rank_views(positions, gains, costs, SETTINGS)[0].utility == 0.0


def test_view_from_where_the_agent_stands_may_be_free() -> None:
    settings = ViewSettings(fixed_cost_steps=0.0)
    positions, gains, costs = np.zeros((2, 2)), np.zeros((2, 36)), np.zeros((2, 36))
    gains[1, 4], costs[1] = 5.0, 3.0
    best, utilities = rank_views(positions, gains, costs, settings)
    assert best.utility == pytest.approx(5.0 / 3.0) == utilities.max()
    assert np.isfinite(utilities).all()


def test_rays_have_fewer_samples_than_a_wall_costs() -> None:
    with pytest.raises(ValueError, match="`ray_step_m` must be more than `max_range_m` / 4095"):
        ViewSettings(max_range_m=5.0, ray_step_m=0.001)


def test_image_holds_what_lies_within_half_the_field_of_view() -> None:
    center = np.array([1.0, 1.25, 2.0])
    directions = np.array([[0.9, 0, -1], [1.1, 0, -1], [0, 0.9, -1], [0, 1.1, -1], [0, 0, 1]], np.float32)
    points = (center + 2.0 * directions).astype(np.float32)
    assert in_image(center, 0.0, points, CAMERA).tolist() == [True, False, True, False, False]
    assert in_image(center, np.pi, points, CAMERA).tolist() == [False, False, False, False, True]


@pytest.mark.parametrize(("hfov_deg", "sectors"), [(90.0, 9.0), (60.0, 6.0), (79.0, 7.9), (5.0, 1.0)])
def test_image_shows_as_much_of_the_circle_as_its_field_of_view(hfov_deg: float, sectors: float) -> None:
    circle = np.ones((1, 36))
    camera = CameraSpec(width_px=8, height_px=8, hfov_deg=hfov_deg)
    np.testing.assert_allclose(sectors_in_view(circle, camera), sectors)


def test_nothing_is_seen_where_there_is_nothing(volume: ObservedVolume) -> None:
    assert expected_visibility(np.zeros((3, 3)), np.zeros((0, 3), np.float32), volume, SETTINGS).shape == (
        3,
        0,
    )
    assert expected_visibility(np.zeros((0, 3)), np.zeros((4, 3), np.float32), volume, SETTINGS).shape == (
        0,
        4,
    )


def test_costs_are_in_the_steps_of_the_agent() -> None:
    positions, distances_m = np.array([[0.0, -1.0]]), np.array([1.0])
    own = replace(SETTINGS, forward_step_m=0.25, turn_step_rad=np.pi / 6.0)
    costs = view_costs(positions, distances_m, np.zeros(2), 0.0, own)
    assert costs[0, 0] == pytest.approx(4.0)
    assert costs[0, SETTINGS.num_headings // 2] == pytest.approx(4.0 + 6.0)


def test_views_near_one_that_was_taken_are_taken_too() -> None:
    taken = TakenViews(radius_m=0.3, angle_rad=np.deg2rad(10.0))
    places = np.array([[0.0, 0.0], [0.29, 0.0], [0.0, -0.31]])
    assert not taken.among(places, 36).any()
    taken.add(np.array([0.0, 0.0]), np.deg2rad(-179.0))
    assert [np.flatnonzero(row).tolist() for row in taken.among(places, 36)] == [[18, 19], [18, 19], []]
