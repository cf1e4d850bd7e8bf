from dataclasses import replace

import numpy as np
import pytest

from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.variable_surface import SurfaceSettings, VariableSurface
from anm_gym.map.view_planner import PlannerSettings, ViewPlanner
from anm_gym.map.views import ViewSettings

START = np.array([-3.0, 0.0])
"""Where `left_room` was seen from."""
TO_THE_DOOR_RAD = -np.pi / 2.0


def test_next_view_costs_steps_and_shows_something(left_room: NeuralMap, rng: np.random.Generator) -> None:
    view = ViewPlanner().plan(left_room, START, 0.0, rng)
    assert view is not None
    assert view.gain > 0.0
    cell = left_room.occupancy.frame.cells_of(view.position_xz)[0]
    assert left_room.occupancy.clearance_m[cell[0], cell[1]] > 0.1


def test_view_under_way_is_kept_unless_another_is_clearly_better(
    left_room: NeuralMap, rng: np.random.Generator
) -> None:
    planner = ViewPlanner(PlannerSettings(keep_share=0.0))
    view = planner.plan(left_room, START, 0.0, rng)
    assert planner.plan(left_room, START, 0.0, rng, current=view) is view
    strict = ViewPlanner(PlannerSettings(keep_share=10.0))
    assert strict.plan(left_room, START, 0.0, rng, current=view) is not view


def test_unseen_space_is_worth_a_view_too(left_room: NeuralMap) -> None:
    nothing = VariableSurface(np.empty((0, 3), np.float32), np.zeros(0, np.float32))
    in_the_door = np.array([[-0.2, 1.25, 0.0]])
    gains = ViewPlanner().expected_gains(left_room, nothing, in_the_door)[0]
    assert gains[27] > 2.0 * gains[9]  # to the other room at -90 degrees, and back
    surface_alone = ViewPlanner(PlannerSettings(unseen_worth=0.0))
    assert not surface_alone.expected_gains(left_room, nothing, in_the_door).any()


def test_unseen_space_is_looked_for_where_no_surface_is_predicted(
    left_room: NeuralMap, rng: np.random.Generator
) -> None:
    nothing_believed = SurfaceSettings(doubt_visibility=-1.0, doubt_m=100.0)
    assert ViewPlanner(PlannerSettings(surface=nothing_believed)).plan(left_room, START, TO_THE_DOOR_RAD, rng)


def test_sampled_points_stand_for_all_of_them(left_room: NeuralMap, rng: np.random.Generator) -> None:
    def total_weight(max_points: int) -> float:
        planner = ViewPlanner(PlannerSettings(views=ViewSettings(max_points=max_points)))
        return float(planner.variable_surface(left_room, START, TO_THE_DOOR_RAD, rng).weights.sum())

    assert total_weight(200) == pytest.approx(total_weight(100_000), rel=0.1)


def test_views_that_were_taken_are_not_planned_again(left_room: NeuralMap, rng: np.random.Generator) -> None:
    planner = ViewPlanner()
    for _ in range(5):
        view = planner.plan(left_room, START, 0.0, rng)
        assert view is not None
        assert not planner.taken.among(view.position_xz[None], 36)[
            0, round(view.heading_rad * 18 / np.pi) % 36
        ]
        planner.note_view(view.position_xz, view.heading_rad)


def test_failed_places_are_left_out(left_room: NeuralMap, rng: np.random.Generator) -> None:
    planner = ViewPlanner(replace(PlannerSettings(), failure_radius_m=1.0))
    view = planner.plan(left_room, START, 0.0, rng)
    assert view is not None
    other = planner.plan(left_room, START, 0.0, rng, excluded_xz=view.position_xz[None])
    assert other is not None
    moved = np.linalg.norm(other.position_xz - view.position_xz)
    assert moved > 1.0 or np.allclose(other.position_xz, START)


def test_agent_outside_the_known_floor_has_no_view(left_room: NeuralMap, rng: np.random.Generator) -> None:
    assert ViewPlanner().plan(left_room, np.array([30.0, 30.0]), 0.0, rng) is None


def test_surface_that_should_be_in_the_image_is_not_looked_for_again(
    left_room: NeuralMap, rng: np.random.Generator
) -> None:
    def planner(settings: SurfaceSettings) -> ViewPlanner:
        return ViewPlanner(PlannerSettings(surface=settings, unseen_worth=0.0))

    doubting = planner(SurfaceSettings(doubt_visibility=-1.0, doubt_m=100.0))
    assert doubting.plan(left_room, START, TO_THE_DOOR_RAD, rng) is None
    trusting = planner(SurfaceSettings(doubt_visibility=2.0))
    assert trusting.plan(left_room, START, TO_THE_DOOR_RAD, rng) is not None


def test_view_that_counts_as_reached_counts_as_taken() -> None:
    settings = PlannerSettings()
    assert settings.for_steps(0.065, np.deg2rad(10.0)).taken_angle_deg == settings.taken_angle_deg
    assert settings.for_steps(0.065, np.deg2rad(45.0)).taken_angle_deg == pytest.approx(0.51 * 45.0)
    assert settings.for_steps(0.065, np.deg2rad(10.0)).taken_radius_m == settings.taken_radius_m
    assert settings.for_steps(0.8, np.deg2rad(10.0)).taken_radius_m == pytest.approx(0.4)
