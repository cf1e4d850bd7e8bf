"""The learned navigator in its seat: goals, stops, stuck places, and the planner behind it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, final

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils import RecordConstructorArgs

from agents.learned_navigator import DDPPONavigator, LearnedSettings
from agents.learned_policy import LearnedPolicy
from agents.navigator_net import NavigatorNet, NavigatorNetSettings
from agents.navigators import NAVIGATORS, make_navigator
from agents.policy_file import save_policy
from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.errors import PolicyError
from anm_gym.mesh import TriangleMesh
from anm_gym.wrappers.goal import ALREADY_THERE, Goal, GoalLimits, GoalWrapper

Explore = Callable[..., ExploreEnv]
STOP, FORWARD, LEFT = (int(action) for action in (Action.STOP, Action.MOVE_FORWARD, Action.TURN_LEFT))


@final
class OneGoal(GoalWrapper):
    """Propose one goal for ever."""

    def __init__(self, env: gymnasium.Env[Any, Any], goal: Goal) -> None:
        RecordConstructorArgs.__init__(self, goal=goal)
        super().__init__(env, limits=GoalLimits(arrival_m=0.2, timeout_steps=900, review_steps=900), seed=0)
        self.only = goal

    def _begin_episode(self) -> None:
        pass

    def _propose_goal(self) -> Goal | None:
        return replace(self.only)

    def _review_goal(self, goal: Goal) -> Goal | None:
        return goal


@pytest.fixture
def seat(explore: Explore, two_rooms: TriangleMesh) -> Callable[..., OneGoal]:
    """Give `seat(x, z, heading)`: an agent at (2, 0) that looks along -z, and its goal."""

    def make(x: float, z: float, heading_rad: float | None = None) -> OneGoal:
        env = explore(two_rooms, start=(2.0, 0.0, 0.0))
        return OneGoal(env, Goal(np.array([x, z]), heading_rad, "script"))

    return make


@pytest.fixture
def habit(tmp_path: Path) -> Callable[..., LearnedSettings]:
    """Give `habit(first, second, **settings)`: a policy that always prefers an action, then another."""

    def make(first: int, second: int, **settings: Any) -> LearnedSettings:
        net = NavigatorNet(NavigatorNetSettings(lstm_size=8))
        with torch.no_grad():
            net.actor.weight.zero_()
            net.actor.bias.zero_()
            net.actor.bias[first], net.actor.bias[second] = 60.0, 30.0
        save_policy(net, tmp_path / "habit.safetensors")
        return LearnedSettings(policy=str(tmp_path / "habit.safetensors"), **settings)

    return make


def drive(env: OneGoal, navigator: DDPPONavigator, steps: int) -> list[int]:
    observation, _ = env.reset(seed=0)
    actions: list[int] = []
    for _ in range(steps):
        action, _ = navigator.predict(observation, None, np.array([not actions]))
        actions.append(int(action))
        observation, *_ = env.step(np.int64(action))
    return actions


def test_stop_away_from_the_goal_is_replaced_by_the_next_choice(seat, habit) -> None:
    env = seat(2.0, -1.5)
    env.reset(seed=0)
    assert set(drive(env, DDPPONavigator(env, habit(STOP, FORWARD)), 8)) == {FORWARD}


def test_stop_is_answered_by_a_random_move_where_that_is_asked_for(seat, habit) -> None:
    env = seat(2.0, -1.5)
    env.reset(seed=0)
    actions = drive(env, DDPPONavigator(env, habit(STOP, FORWARD, stop="random")), 30)
    assert set(actions) == {1, 2, 3}


def test_agent_at_its_goal_turns_to_where_it_should_look(seat, habit) -> None:
    env = seat(2.0, 0.1, np.pi / 2)
    env.reset(seed=0)
    actions = drive(env, DDPPONavigator(env, habit(FORWARD, LEFT)), 9)
    assert actions[:8] == [LEFT] * 8
    assert len(env.goals) > 1, "the goal has been reached"


@pytest.mark.parametrize("resets_memory", [True, False])
def test_state_is_forgotten_at_every_new_goal_unless_asked_not_to(
    seat, habit, monkeypatch: pytest.MonkeyPatch, resets_memory: bool
) -> None:
    begun: list[int] = []
    monkeypatch.setattr(LearnedPolicy, "begin", lambda _, index: begun.append(index))
    env = seat(2.0, -1.5)
    env.reset(seed=0)
    settings = habit(LEFT, FORWARD, patience_steps=10, resets_memory=resets_memory)
    drive(env, DDPPONavigator(env, settings), 30)
    assert len(env.failures) == 2
    assert begun == ([0] * 3 if resets_memory else [])


def test_paper_variant_keeps_its_state_and_answers_stops_at_random(seat) -> None:
    env = seat(2.0, -1.5)
    env.reset(seed=0)
    navigator = make_navigator("ddppo-paper", env)
    settings = navigator.settings
    assert (settings.resets_memory, settings.has_reflexes, settings.stop) == (False, False, "random")
    assert STOP not in drive(env, navigator, 20)


def test_goal_without_progress_is_reported(seat, habit) -> None:
    env = seat(2.0, -1.5)
    env.reset(seed=0)
    drive(env, DDPPONavigator(env, habit(LEFT, FORWARD, patience_steps=10)), 30)
    assert [failure.reason for failure in env.failures][:2] == ["no progress"] * 2
    assert env.handovers == []


def test_planner_takes_over_where_the_policy_is_stuck_and_the_record_says_so(seat, habit) -> None:
    env = seat(2.0, -1.5)
    observation, _ = env.reset(seed=0)
    navigator = DDPPONavigator(env, habit(LEFT, FORWARD, patience_steps=10, hands_over=True))
    info: dict[str, Any] = {}
    for step in range(90):
        action, _ = navigator.predict(observation, None, np.array([step == 0]))
        observation, _, _, _, info = env.step(np.int64(action))
        if len(env.goals) > 1:
            break
    assert len(env.goals) > 1, "the goal has been reached"
    assert {failure.reason for failure in env.failures} == {ALREADY_THERE}, (
        "and is proposed again on the spot"
    )
    assert info["handovers_count"] == 1
    assert env.handovers[0].reason == "no progress"


def test_second_episode_does_not_depend_on_the_first(seat, habit) -> None:
    env = seat(2.0, -1.5)
    navigator = DDPPONavigator(env, habit(LEFT, FORWARD, patience_steps=10, hands_over=True))
    trails = []
    for _ in range(2):
        observation, _ = env.reset(seed=0)
        trail = []
        for step in range(40):
            action, _ = navigator.predict(observation, None, np.array([step == 0]))
            observation, *_ = env.step(np.int64(action))
            trail.append(int(action))
        trails.append(trail)
    assert env.handovers, "the planner has driven"
    assert trails[0] == trails[1]


def test_new_episode_is_noticed_without_being_told(seat, habit) -> None:
    env = seat(2.0, -1.5)
    navigator = DDPPONavigator(env, habit(LEFT, FORWARD))
    trails = []
    for _ in range(2):
        observation, _ = env.reset(seed=0)
        trail = []
        for _ in range(15):
            action, _ = navigator.predict(observation)
            observation, *_ = env.step(np.int64(action))
            trail.append(int(action))
        trails.append(trail)
    assert trails[0] == trails[1]


def test_same_seed_same_moves(seat, habit) -> None:
    env = seat(2.0, -1.5)
    env.reset(seed=0)
    settings = replace(habit(STOP, STOP))
    first, second, other = (drive(env, DDPPONavigator(env, settings, seed), 12) for seed in (0, 0, 1))
    assert first == second
    assert first != other


def test_navigators_say_what_they_want() -> None:
    with pytest.raises(ValueError, match="`stop` must be one of go_on, random, got 'never'"):
        LearnedSettings(stop="never")
    assert {"planner", "oracle", "ddppo-plus", "ddppo-star", "ddppo+fallback"} <= NAVIGATORS.keys()


def test_missing_weights_are_a_named_error(seat) -> None:
    env = seat(2.0, -1.5)
    env.reset(seed=0)
    with pytest.raises(PolicyError, match="unknown policy 'nobody'"):
        DDPPONavigator(env, LearnedSettings(policy="nobody"))
    with pytest.raises(ValueError, match="unknown navigator 'taxi'; choose one of: "):
        make_navigator("taxi", env)
