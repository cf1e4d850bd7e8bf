from dataclasses import replace

import numpy as np

from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.variable_surface import SurfaceSettings
from anm_gym.map.view_planner import PlannerSettings, ViewPlanner
from anm_gym.map.views import View
from anm_gym.map.volume import UNKNOWN

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
    def view(unseen_worth: float) -> View:
        planner = ViewPlanner(PlannerSettings(unseen_worth=unseen_worth))
        found = planner.plan(left_room, START, 0.0, np.random.default_rng(0))
        assert found is not None
        return found

    through_the_door = view(1e6)
    assert through_the_door.gain > 1e6 > view(0.0).gain
    assert -np.sin(through_the_door.heading_rad) > 0.5
    assert left_room.volume.state_at(np.array([2.0, 1.25, 1.5])) == UNKNOWN


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
    assert planner.plan(left_room, START, TO_THE_DOOR_RAD, rng) is None
    trusting = ViewPlanner(PlannerSettings(surface=SurfaceSettings(doubt_visibility=2.0)))
    assert trusting.plan(left_room, START, TO_THE_DOOR_RAD, rng) is not None
