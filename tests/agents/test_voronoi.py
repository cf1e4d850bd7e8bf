from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from agents.voronoi import PRESETS, VoronoiGoalWrapper, _Views
from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.map.presets import map_settings
from anm_gym.mesh import TriangleMesh
from anm_gym.wrappers.goal import Goal
from anm_gym.wrappers.neural_map import NeuralMapWrapper

Explore = Callable[..., ExploreEnv]
IN_THE_LEFT_ROOM = (-3.0, 0.0, np.pi / 2)
"""Start in the left room with the door, at x = 0, behind."""


FAST = map_settings("fast")
SMALL = replace(
    FAST,
    field=replace(FAST.field, width=16),
    sampling=replace(FAST.sampling, rays_per_frame=10, fill_in_rays=50),
    schedule=replace(FAST.schedule, first_iterations=5),
)
"""A map that learns little, but fast."""


def turned(explore: Explore, mesh: TriangleMesh, preset: str = "fast", seed: int = 0) -> VoronoiGoalWrapper:
    """An agent in the left room after its turn at the start, in steps of 30 degrees."""
    env = explore(mesh, start=IN_THE_LEFT_ROOM, turn_step_deg=30.0)
    wrapped = VoronoiGoalWrapper(NeuralMapWrapper(env, settings=SMALL), preset=preset, seed=seed)
    wrapped.reset(seed=0)
    for _ in range(12):
        wrapped.step(np.int64(Action.TURN_LEFT))
    return wrapped


@pytest.mark.parametrize("preset", ["fast", "scale"])
def test_goal_is_on_the_graph_or_looks_round_from_here(
    explore: Explore, two_rooms: TriangleMesh, preset: str
) -> None:
    env = turned(explore, two_rooms, preset)
    assert [goal.reason for goal in env.goals[:4]] == ["sweep", "sweep", "sweep", "vertex"]
    row, column = env.occupancy.frame.cells_of(env.goal.position_xz)[0]
    assert env.occupancy.free[row, column]


def test_seen_room_is_left_for_the_door(explore: Explore, two_rooms: TriangleMesh) -> None:
    env = turned(explore, two_rooms)
    assert env.goal.reason == "vertex"
    assert env.goal.heading_rad is not None
    assert env.goal.position_xz[0] > -1.5


def test_each_point_is_anchored_once(explore: Explore, two_rooms: TriangleMesh) -> None:
    env = turned(explore, two_rooms)
    views = env._views(None)
    assert views is not None
    assert len(views.positions_xz) == len(views.lengths_m) == len(views.gains)
    assert views.lengths_m[-1] == 0.0
    widest = views.gains.max(axis=1).sum()
    assert 0.0 < widest <= env.settings.planning.views.max_points


def test_vertices_that_failed_are_left_out(explore: Explore, two_rooms: TriangleMesh) -> None:
    env = turned(explore, two_rooms)
    failed = env.goal.position_xz
    assert env.goal.reason == "vertex"
    env.report_unreachable("no way")
    assert env.goal.reason == "vertex"
    assert np.linalg.norm(env.goal.position_xz - failed) > env.settings.planning.failure_radius_m


def test_classes_prefer_places_not_visited(explore: Explore, two_rooms: TriangleMesh) -> None:
    env = turned(explore, two_rooms, "scale")
    env.settings = replace(env.settings, min_gain=1e9)  # nothing is worth a look
    env.report_unreachable("another")
    gaps = np.linalg.norm(np.stack(env._trail_xz) - env.goal.position_xz, axis=1)
    assert env.goal.heading_rad is None
    assert gaps.min() > env.settings.visited_m


@pytest.fixture
def by_classes(explore: Explore, two_rooms: TriangleMesh) -> VoronoiGoalWrapper:
    """An agent at (-3, 0) that chooses by classes."""
    env = explore(two_rooms, start=IN_THE_LEFT_ROOM)
    wrapped = VoronoiGoalWrapper(NeuralMapWrapper(env, settings=SMALL), preset="scale")
    wrapped.reset(seed=0)
    return wrapped


def preferred(env: VoronoiGoalWrapper, *vertices: tuple[float, float, float, float]) -> int:
    """Which vertex comes first, of (x, z, length of the way, gain); nothing is left to look at here."""
    x, z, lengths_m, gains = np.array([*vertices, (*env.position_xz, 0.0, 0.0)]).T
    positions = np.stack([x, z], axis=1)
    goal = env._first_by_class(_Views(positions, lengths_m, gains[:, None] * np.ones(36)))
    assert goal is not None
    return int(np.linalg.norm(positions - goal.position_xz, axis=1).argmin())


def test_nearest_of_a_class_comes_first(by_classes: VoronoiGoalWrapper) -> None:
    assert preferred(by_classes, (-3.0, 1.5, 3.0, 0.0), (-3.0, -1.5, 2.0, 0.0)) == 1


def test_classes_prefer_what_is_away_from_the_trail(by_classes: VoronoiGoalWrapper) -> None:
    assert preferred(by_classes, (-3.0, 1.0, 2.0, 0.0), (-3.0, 0.95, 1.0, 0.0)) == 0


def test_classes_prefer_the_local_horizon(by_classes: VoronoiGoalWrapper) -> None:
    assert preferred(by_classes, (-3.0, 1.5, 4.0, 0.0), (0.5, 0.0, 3.5, 0.0)) == 0
    by_classes.settings = replace(by_classes.settings, horizon_m=4.0)
    assert preferred(by_classes, (-3.0, 1.5, 4.0, 0.0), (0.5, 0.0, 3.5, 0.0)) == 1


def test_classes_prefer_what_shows_something(by_classes: VoronoiGoalWrapper) -> None:
    assert preferred(by_classes, (-3.0, 1.5, 3.0, 1.0), (-3.0, -1.5, 2.0, 0.0)) == 0


def test_classes_put_failures_behind_what_is_seen_from_afar(by_classes: VoronoiGoalWrapper) -> None:
    vertices = (-3.0, 1.5, 2.0, 1.0), (0.5, 0.0, 3.5, 0.0)
    assert preferred(by_classes, *vertices) == 0
    by_classes.failures.append(Goal(np.array([-3.0, 1.5]), None, "no way"))
    assert preferred(by_classes, *vertices) == 1


def test_classes_put_long_ways_last(by_classes: VoronoiGoalWrapper) -> None:
    by_classes.failures.append(Goal(np.array([0.5, 0.0]), None, "no way"))
    assert preferred(by_classes, (-3.0, 1.5, 12.9, 1.0), (0.5, 0.0, 3.5, 0.0)) == 0
    assert preferred(by_classes, (-3.0, 1.5, 13.1, 1.0), (0.5, 0.0, 3.5, 0.0)) == 1


def test_goal_under_way_is_kept_while_it_serves(explore: Explore, two_rooms: TriangleMesh) -> None:
    env = turned(explore, two_rooms)
    chosen = env.goal
    assert env._review_goal(chosen) is chosen


def test_same_seed_proposes_the_same_goals(explore: Explore, two_rooms: TriangleMesh) -> None:
    goals = []
    for _ in range(2):
        env = turned(explore, two_rooms, seed=2)
        goals.append([(*goal.position_xz, goal.heading_rad) for goal in env.goals])
    assert goals[0] == goals[1]


def test_map_below_is_needed(explore: Explore, two_rooms: TriangleMesh) -> None:
    with pytest.raises(ValueError, match="`env` must have a neural map; wrap it in NeuralMapWrapper first"):
        VoronoiGoalWrapper(explore(two_rooms))


def test_unknown_preset_lists_the_choices(explore: Explore, two_rooms: TriangleMesh) -> None:
    assert sorted(PRESETS) == ["best", "fast", "scale"]
    mapped = NeuralMapWrapper(explore(two_rooms), preset="fast")
    with pytest.raises(ValueError, match="unknown Voronoi preset 'slow'; choose one of: best, fast, scale"):
        VoronoiGoalWrapper(mapped, preset="slow")
