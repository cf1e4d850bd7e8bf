from collections.abc import Callable
from itertools import pairwise
from typing import Any, final

import gymnasium
import numpy as np
import pytest
from gymnasium.utils import RecordConstructorArgs

from agents.navigators import make_navigator
from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.mesh import TriangleMesh
from anm_gym.wrappers.goal import Goal, GoalLimits, GoalWrapper
from anm_gym.wrappers.moves_only import MovesOnlyWrapper

Explore = Callable[..., ExploreEnv]
MEAN_STEP_M = 0.065
PLANNERS = ["oracle", "planner"]


@final
class GoalList(GoalWrapper):
    """Propose a list of goals, the last one for ever."""

    def __init__(self, env: gymnasium.Env[Any, Any], script: list[Goal]) -> None:
        RecordConstructorArgs.__init__(self, script=script)
        super().__init__(env, limits=GoalLimits(arrival_m=0.15, timeout_steps=900, review_steps=900), seed=0)
        self.script = script

    def _begin_episode(self) -> None:
        self.waiting = list(self.script)

    def _propose_goal(self) -> Goal | None:
        return self.waiting.pop(0) if len(self.waiting) > 1 else self.waiting[0]

    def _review_goal(self, goal: Goal) -> Goal | None:
        return goal


def goals(*poses: tuple[float, float, float | None]) -> list[Goal]:
    return [Goal(np.array([x, z]), heading, "script") for x, z, heading in poses]


def drive(env: GoalList, name: str, steps: int) -> list[Action]:
    """Drive until all goals but the last have ended, or the steps are used up."""
    navigator = make_navigator(name, env)
    observation, _ = env.reset(seed=0)
    actions: list[Action] = []
    while len(actions) < steps and len(env.goals) < len(env.script):
        action, _ = navigator.predict(observation, None, np.array([not actions]))
        actions.append(Action(int(action)))
        observation, *_ = env.step(np.int64(action))
    return actions


@pytest.mark.parametrize("name", PLANNERS)
def test_goal_in_the_next_room_is_reached_by_nearly_the_shortest_way(
    explore: Explore, two_rooms: TriangleMesh, name: str
) -> None:
    env = GoalList(
        explore(two_rooms, start=(-3.0, -1.0, 0.0)), goals((3.0, -1.5, np.pi / 2), (0.0, 0.0, None))
    )
    simulator = env.unwrapped.simulator  # type: ignore[attr-defined]
    actions = drive(env, name, 300)
    assert env.failures == []
    shortest_m = simulator.geodesic_distance_m((-3.0, -1.0), (3.0, -1.5))
    turns = 9 + 18
    assert len(actions) <= 1.3 * (shortest_m / MEAN_STEP_M + turns)
    assert env.unwrapped.collisions == 0  # type: ignore[attr-defined]
    assert np.cos(env.heading_rad - np.pi / 2) > np.cos(np.deg2rad(10.5))


def test_steps_of_a_centimetre_and_a_half_are_not_taken_for_contacts(
    explore: Explore, box_room: Callable[..., TriangleMesh]
) -> None:
    env = GoalList(
        explore(box_room(), start=(0.0, 1.5, 0.0), forward_step_m=0.015),
        goals((0.0, 0.0, None), (1.0, 1.0, None)),
    )
    actions = drive(env, "planner", 150)
    assert env.failures == []
    assert actions.count(Action.MOVE_FORWARD) > 0.9 * len(actions)


def test_turns_are_not_undone_at_once(explore: Explore, two_rooms: TriangleMesh) -> None:
    tour = goals((3.0, -1.5, None), (-3.0, 1.0, None), (2.0, 1.2, None), (-3.5, -1.5, None), (0.0, 0.0, None))
    env = GoalList(explore(two_rooms, start=(-3.0, -1.0, 0.0)), tour)
    actions = drive(env, "planner", 700)
    opposite = {Action.TURN_LEFT: Action.TURN_RIGHT, Action.TURN_RIGHT: Action.TURN_LEFT}
    flicker = sum(opposite.get(a) is b for a, b in pairwise(actions))
    assert env.failures == []
    assert flicker <= 4


def test_obstacle_under_the_view_is_felt_and_gone_round(
    explore: Explore, box_room: Callable[..., TriangleMesh], with_step: Callable[..., TriangleMesh]
) -> None:
    mesh = with_step(box_room(5.0, 5.0), x_m=(-0.6, 0.6), z_m=(-0.25, -0.2), height_m=0.3)
    env = GoalList(explore(mesh, start=(0.0, 0.0, 0.0)), goals((0.0, -1.5, None), (1.0, 1.0, None)))
    drive(env, "planner", 200)
    assert env.unwrapped.collisions >= 1  # type: ignore[attr-defined]
    assert env.failures == []
    assert len(env.goals) == 2


@pytest.mark.parametrize("name", PLANNERS)
def test_goal_behind_closed_walls_is_reported(
    explore: Explore, box_room: Callable[..., TriangleMesh], name: str
) -> None:
    env = GoalList(explore(box_room(), start=(0.0, 0.0, 0.0)), goals((5.0, 0.0, None), (1.0, 1.0, None)))
    drive(env, name, 120)
    assert len(env.failures) == 1


def test_agent_with_nowhere_to_go_moves_at_random_but_always_the_same(
    explore: Explore, box_room: Callable[..., TriangleMesh]
) -> None:
    env = GoalList(explore(box_room(), start=(0.0, 0.0, 0.0)), goals((5.0, 0.0, None)))
    navigator = make_navigator("oracle", env, seed=3)
    episodes = []
    for _ in range(2):
        observation, _ = env.reset(seed=0)
        episodes.append([])
        for step in range(12):
            action, _ = navigator.predict(observation, None, np.array([step == 0]))
            episodes[-1].append(int(action))
            observation, *_ = env.step(np.int64(action))
    assert episodes[0] == episodes[1]
    assert len(set(episodes[0])) == 3


def test_time_to_plan_is_charged(explore: Explore, box_room: Callable[..., TriangleMesh]) -> None:
    env = GoalList(explore(box_room(), start=(0.0, 0.0, 0.0)), goals((1.0, 0.0, None)))
    navigator = make_navigator("planner", env)
    observation, _ = env.reset(seed=0)
    navigator.predict(observation)
    assert list(navigator.compute_ms) == ["plan"]


def test_unknown_navigator_lists_the_choices(explore: Explore, box_room: Callable[..., TriangleMesh]) -> None:
    env = GoalList(explore(box_room()), goals((1.0, 0.0, None)))
    with pytest.raises(
        ValueError, match="unknown navigator 'teleport'; choose one of: planner, oracle, ddppo, "
    ):
        make_navigator("teleport", env)


def test_navigator_needs_all_actions(explore: Explore, box_room: Callable[..., TriangleMesh]) -> None:
    env = GoalList(MovesOnlyWrapper(explore(box_room())), goals((1.0, 0.0, None)))
    with pytest.raises(ValueError, match="must have the 4 actions of ANM/Explore-v0, got Discrete"):
        make_navigator("planner", env)


def test_navigator_needs_goals(explore: Explore, box_room: Callable[..., TriangleMesh]) -> None:
    with pytest.raises(TypeError, match="must be wrapped in a GoalWrapper, got ExploreEnv"):
        make_navigator("planner", explore(box_room()))
