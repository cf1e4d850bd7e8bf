from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from agents.rh_nbv import PRESETS, RhNbvGoalWrapper
from agents.view_tree import ViewTree, grow_view_tree
from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.map.unseen_volume import UnseenByCell
from anm_gym.mesh import TriangleMesh
from anm_gym.wrappers.goal import Goal

Explore = Callable[..., ExploreEnv]
IN_THE_LEFT_ROOM = (-2.0, 0.0, np.pi / 2)
"""Start in the left room with the door behind."""


def turn_round(env: RhNbvGoalWrapper, turns: int = 36) -> None:
    for _ in range(turns):
        env.step(np.int64(Action.TURN_LEFT))


@pytest.fixture
def turned(explore: Explore, two_rooms: TriangleMesh) -> RhNbvGoalWrapper:
    """An agent that has seen all of the left room that can be seen from its middle."""
    env = RhNbvGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM))
    env.reset(seed=0)
    turn_round(env)
    env.report_unreachable("a new choice")
    return env


@pytest.mark.parametrize("preset", sorted(PRESETS))
def test_first_goal_is_a_view_within_an_edge(explore: Explore, two_rooms: TriangleMesh, preset: str) -> None:
    env = RhNbvGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM), preset=preset)
    env.reset(seed=0)
    assert env.goal.reason == "view"
    assert np.linalg.norm(env.goal.position_xz - env.position_xz) <= 1.5
    assert not env.is_reached(env.goal)


def test_first_edge_leads_towards_what_is_unseen(turned: RhNbvGoalWrapper) -> None:
    assert turned.goal.reason == "on the way"
    assert turned.goal.position_xz[0] > turned.position_xz[0] + 0.3


def test_branch_under_way_is_kept_on_review(turned: RhNbvGoalWrapper) -> None:
    chosen = turned.goal
    for action in (Action.TURN_LEFT, Action.TURN_RIGHT) * 10:
        turned.step(np.int64(action))
    assert turned.goal is chosen


def test_branch_that_shows_less_than_promised_is_given_up(explore: Explore, two_rooms: TriangleMesh) -> None:
    strict = replace(PRESETS["strong"], review_share=10.0)
    env = RhNbvGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM), settings=strict)
    env.reset(seed=0)
    before = len(env.goals)
    turn_round(env, env.limits.review_steps)
    assert len(env.goals) > before


def limit_growth(env: RhNbvGoalWrapper, iterations: int, max_iterations: int) -> None:
    tree = replace(env.settings.tree, iterations=iterations)
    env.settings = replace(env.settings, tree=tree, max_iterations=max_iterations)


def grow_hardly(env: RhNbvGoalWrapper) -> list[NDArray[np.float64]]:
    """Let trees be little more than the branch that they go on from; give that branch."""
    limit_growth(env, 1, 1)
    return env._branch


def gap_m(goal: Goal | None, branch: list[NDArray[np.float64]]) -> float:
    """How far a goal is from the nearest place of a branch, metres."""
    assert goal is not None
    return float(np.linalg.norm(np.stack(branch) - goal.position_xz, axis=1).min())


def test_tree_goes_on_from_the_branch_that_was_chosen(turned: RhNbvGoalWrapper) -> None:
    branch = grow_hardly(turned)
    goal = turned._propose_goal()
    assert goal is not None
    assert goal.reason == "view"
    assert gap_m(goal, branch) < 1e-6
    assert gap_m(goal, turned._branch) < 1e-6


def test_branch_on_which_a_goal_failed_is_forgotten(turned: RhNbvGoalWrapper) -> None:
    branch = grow_hardly(turned)
    turned.report_unreachable("no way")
    assert gap_m(turned.goal, branch) > 0.1


def test_tree_grows_to_its_limit_and_no_farther(
    turned: RhNbvGoalWrapper, monkeypatch: pytest.MonkeyPatch
) -> None:
    limit_growth(turned, 30, 200)
    sizes: list[int] = []

    def grow(*arguments: Any) -> ViewTree:
        sizes.append(arguments[3].iterations)
        return grow_view_tree(*arguments)

    monkeypatch.setattr("agents.rh_nbv.grow_view_tree", grow)
    monkeypatch.setattr("agents.rh_nbv.best_looks", lambda *_: [])
    turned.report_unreachable("again")
    assert sizes == [30, 60, 120, 200]


def test_tree_grows_until_a_look_shows_something(
    turned: RhNbvGoalWrapper, monkeypatch: pytest.MonkeyPatch
) -> None:
    limit_growth(turned, 10, 80)
    sizes: list[int] = []
    least = 30

    def shown_by_large_trees(positions_xz: NDArray[np.float64]) -> UnseenByCell:
        sizes.append(len(positions_xz))
        share = np.full((len(positions_xz), 36, 1), float(len(positions_xz) >= least), np.float32)
        return UnseenByCell(np.array([5.0]), share, share.copy())

    monkeypatch.setattr(turned._views, "by_cell", shown_by_large_trees)
    turned.report_unreachable("again")
    assert turned.goal.reason == "view"
    assert len(sizes) == 3
    assert sizes[0] < sizes[1] < least <= sizes[2]
    sizes.clear()
    least = 1000
    turned.report_unreachable("again")
    assert turned.goal.reason == "wander"
    assert len(sizes) == 4


def test_look_that_is_being_taken_is_not_a_goal(explore: Explore, two_rooms: TriangleMesh) -> None:
    env = RhNbvGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM))
    env.reset(seed=0)
    for _ in range(8):
        env.report_unreachable("again")
        here = Goal(env.position_xz, env.heading_rad, "here")
        assert env.is_reached(here)
        assert not env.is_reached(env.goal)


def test_looks_that_were_taken_are_not_goals_again(
    turned: RhNbvGoalWrapper, monkeypatch: pytest.MonkeyPatch
) -> None:
    def always_unseen_from_here(positions_xz: NDArray[np.float64]) -> UnseenByCell:
        share = np.zeros((len(positions_xz), 36, 1), np.float32)
        share[np.linalg.norm(positions_xz - turned.position_xz, axis=1) < 0.1] = 1.0
        return UnseenByCell(np.array([5.0]), share, share.copy())

    monkeypatch.setattr(turned._views, "by_cell", always_unseen_from_here)
    turned.report_unreachable("again")
    assert turned.goal.reason == "wander"


def test_same_seed_proposes_the_same_goals(explore: Explore, two_rooms: TriangleMesh) -> None:
    goals = []
    for _ in range(2):
        env = RhNbvGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM), seed=3)
        env.reset(seed=1)
        turn_round(env, 12)
        goals.append([(*goal.position_xz, goal.heading_rad) for goal in env.goals])
    assert goals[0] == goals[1]


def test_unknown_preset_lists_the_choices(explore: Explore, two_rooms: TriangleMesh) -> None:
    with pytest.raises(ValueError, match="unknown RH-NBV preset 'weak'; choose one of: strong, paper"):
        RhNbvGoalWrapper(explore(two_rooms), preset="weak")
