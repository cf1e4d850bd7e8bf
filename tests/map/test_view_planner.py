from dataclasses import replace

import numpy as np
import pytest

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.presets import map_settings
from anm_gym.map.view_planner import (
    PlannerSettings,
    SurfaceSettings,
    VariableSurface,
    ViewPlanner,
    weigh_by_variability,
    worthwhile_points,
)
from anm_gym.map.volume import UNKNOWN
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.backends import make_depth_camera

START = np.array([-3.0, 0.0])


@pytest.fixture(scope="module")
def left_room(two_rooms: TriangleMesh) -> NeuralMap:
    """A map of the left of two rooms, seen in one turn from (-3, 0); the door is at x = 0."""
    camera = CameraSpec(width_px=64, height_px=64)
    renderer = make_depth_camera(two_rooms, camera)
    neural_map = NeuralMap(map_settings("fast"), camera)
    for angle in np.deg2rad(np.arange(0.0, 360.0, 20.0)):
        pose = camera_pose((START[0], 1.25, START[1]), float(angle))
        neural_map.integrate(renderer.render(pose), pose)
    return neural_map


def test_points_worth_a_look_lie_in_space_that_was_not_seen(left_room: NeuralMap) -> None:
    surface = worthwhile_points(left_room, SurfaceSettings())
    assert len(surface.points) > 20
    assert (left_room.volume.state_at(surface.points) == UNKNOWN).all()
    assert left_room.cloud.distance_of(surface.points).min() > 0.15


def test_all_surface_counts_when_variability_alone_is_trusted(left_room: NeuralMap) -> None:
    everything = worthwhile_points(left_room, SurfaceSettings(only_unseen=False))
    assert len(everything.points) > len(worthwhile_points(left_room, SurfaceSettings()).points)


def test_rim_of_free_space_is_in_the_door_and_can_be_left_out(left_room: NeuralMap) -> None:
    with_rim = worthwhile_points(left_room, SurfaceSettings(frontier_share=0.5))
    without = worthwhile_points(left_room, SurfaceSettings(frontier_share=0.0))
    rim = with_rim.points[with_rim.weights == 0.5]
    assert len(with_rim.points) == len(without.points) + len(rim) > len(without.points)
    assert left_room.cloud.distance_of(rim).min() > 0.3
    assert (rim[:, 0] > -0.5).any()


def test_well_known_surface_weighs_less_than_surface_never_seen(left_room: NeuralMap) -> None:
    seen = left_room.cloud.points[::40]
    beyond = seen + np.array([8.0, 0.0, 0.0], np.float32)
    points = VariableSurface(np.concatenate([seen, beyond]), np.ones(2 * len(seen), np.float32))
    weights = weigh_by_variability(left_room, points, SurfaceSettings()).weights
    assert ((weights >= 0.0) & (weights < 1.0)).all()
    assert np.median(weights[: len(seen)]) < 0.5 < 0.9 < np.median(weights[len(seen) :])


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
    planner = ViewPlanner(PlannerSettings(surface=SurfaceSettings(doubt_visibility=-1.0, doubt_m=100.0)))
    assert planner.plan(left_room, START, 0.0, rng) is None
    trusting = ViewPlanner(PlannerSettings(surface=SurfaceSettings(doubt_visibility=2.0)))
    assert trusting.plan(left_room, START, 0.0, rng) is not None
