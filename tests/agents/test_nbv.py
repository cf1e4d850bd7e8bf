from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from agents.nbv import PRESETS, NbvGoalWrapper, NbvSettings
from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.geometry import wrap_angle
from anm_gym.mesh import TriangleMesh

Explore = Callable[..., ExploreEnv]
IN_THE_LEFT_ROOM = (-2.0, 0.0, np.pi / 2)
"""Start in the left room with the door behind."""


def turn_round(env: NbvGoalWrapper, turns: int = 36) -> None:
    for _ in range(turns):
        env.step(np.int64(Action.TURN_LEFT))


@pytest.mark.parametrize("preset", sorted(PRESETS))
def test_first_view_looks_where_nothing_was_seen(
    explore: Explore, two_rooms: TriangleMesh, preset: str
) -> None:
    env = NbvGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM), preset=preset)
    env.reset(seed=0)
    assert env.goal.reason == "view"
    assert env.goal.heading_rad is not None
    assert abs(wrap_angle(env.goal.heading_rad - np.pi / 2)) > np.deg2rad(40.0)


def test_room_that_is_seen_is_left_through_the_door(explore: Explore, two_rooms: TriangleMesh) -> None:
    env = NbvGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM))
    env.reset(seed=0)
    turn_round(env)
    env.report_unreachable("a new choice")
    assert env.goal.reason == "view"
    assert env.goal.position_xz[0] > -0.8


def test_view_under_way_is_kept(explore: Explore, two_rooms: TriangleMesh) -> None:
    env = NbvGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM))
    env.reset(seed=0)
    turn_round(env)
    env.report_unreachable("a new choice")
    chosen = env.goal
    for action in (Action.TURN_LEFT, Action.TURN_RIGHT) * 10:
        env.step(np.int64(action))
    assert env.goal is chosen


def test_view_under_way_is_dropped_once_no_view_shows_anything(
    explore: Explore, two_rooms: TriangleMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    env = NbvGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM))
    env.reset(seed=0)
    assert env.goal.reason == "view"
    monkeypatch.setattr(env._views, "gains", lambda positions_xz: np.zeros((len(positions_xz), 36)))
    assert env._review_goal(env.goal) is None


def test_places_that_failed_are_left_out(explore: Explore, two_rooms: TriangleMesh) -> None:
    env = NbvGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM))
    env.reset(seed=0)
    turn_round(env)
    for _ in range(5):
        failed = env.goal.position_xz
        env.report_unreachable("no way")
        is_own_place = np.linalg.norm(env.goal.position_xz - env.position_xz) < 1e-6
        assert is_own_place or np.linalg.norm(env.goal.position_xz - failed) > 0.4


def test_views_that_show_too_little_are_not_proposed(
    explore: Explore, box_room: Callable[..., TriangleMesh]
) -> None:
    settings = replace(PRESETS["strong"], min_gain_m3=4.0)
    env = NbvGoalWrapper(explore(box_room(), start=(0.0, 0.0, 0.0)), settings=settings)
    env.reset(seed=0)
    assert env.goal.reason == "view"
    turn_round(env)
    env.report_unreachable("a new choice")
    assert env.goal.reason == "wander"
    assert env._review_goal(env.goal) is env.goal


def test_discount_by_length_prefers_what_is_near(explore: Explore, two_rooms: TriangleMesh) -> None:
    lengths = {}
    for decay in (0.0, 5.0):
        settings = NbvSettings(utility="exponential", decay_per_m=decay)
        env = NbvGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM), settings=settings)
        env.reset(seed=0)
        lengths[decay] = float(np.linalg.norm(env.goal.position_xz - env.position_xz))
    assert lengths[5.0] < lengths[0.0]


def test_discount_by_length_does_not_count_turns(explore: Explore, two_rooms: TriangleMesh) -> None:
    env = NbvGoalWrapper(
        explore(two_rooms, start=IN_THE_LEFT_ROOM), settings=NbvSettings(utility="exponential")
    )
    env.reset(seed=0)
    positions, lengths_m = env.position_xz[None] + [[1.0, 0.0], [0.0, 2.0]], np.array([1.0, 2.0])
    _, utilities = env._rank(positions, lengths_m, np.ones((2, 4)))
    assert utilities[0] == pytest.approx(utilities[0, 0])
    assert utilities[1] / utilities[0] == pytest.approx(np.exp(-0.5))


def test_same_seed_proposes_the_same_views(explore: Explore, two_rooms: TriangleMesh) -> None:
    views = []
    for _ in range(2):
        env = NbvGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM), seed=3)
        env.reset(seed=1)
        turn_round(env, 12)
        views.append([(*goal.position_xz, goal.heading_rad) for goal in env.goals])
    assert views[0] == views[1]


def test_unknown_preset_lists_the_choices(explore: Explore, two_rooms: TriangleMesh) -> None:
    with pytest.raises(ValueError, match="unknown NBV preset 'weak'; choose one of: strong, exponential"):
        NbvGoalWrapper(explore(two_rooms), preset="weak")


def test_views_that_were_taken_are_not_goals_again(
    explore: Explore, two_rooms: TriangleMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    env = NbvGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM))
    env.reset(seed=0)
    turn_round(env)

    def most_from_here(positions_xz: NDArray[np.float64]) -> NDArray[np.float64]:
        is_here = np.linalg.norm(positions_xz - env.position_xz, axis=1) < 0.1
        return np.where(is_here, 9.0, 1.0)[:, None] * np.ones(36)

    monkeypatch.setattr(env._views, "gains", most_from_here)
    env.report_unreachable("a new choice")
    assert np.linalg.norm(env.goal.position_xz - env.position_xz) > env.limits.arrival_m
