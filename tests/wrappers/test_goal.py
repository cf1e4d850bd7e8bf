from collections.abc import Callable
from typing import Any, final

import gymnasium
import numpy as np
import pytest
from gymnasium.utils import RecordConstructorArgs

from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.geometry import pointgoal
from anm_gym.mesh import TriangleMesh
from anm_gym.wrappers.goal import ALREADY_THERE, MAX_PROPOSALS, Goal, GoalLimits, GoalWrapper

LIMITS = GoalLimits(arrival_m=0.2, timeout_steps=30, review_steps=7)
START = (0.0, 0.5, 0.0)


@final
class ScriptedGoals(GoalWrapper):
    """Propose a list of goals, then nothing."""

    def __init__(self, env: gymnasium.Env[Any, Any], script: list[Goal], limits: GoalLimits = LIMITS) -> None:
        RecordConstructorArgs.__init__(self, script=script, limits=limits)
        super().__init__(env, limits=limits, seed=0)
        self.script = script
        self.review: Callable[[Goal], Goal | None] = lambda goal: goal
        self.observations = 0

    def _begin_episode(self) -> None:
        self.waiting = list(self.script)

    def _see(self, observation: Any) -> None:
        self.observations += 1

    def _propose_goal(self) -> Goal | None:
        return self.waiting.pop(0) if self.waiting else None

    def _review_goal(self, goal: Goal) -> Goal | None:
        return self.review(goal)


def goal(x: float, z: float, heading_rad: float | None = None) -> Goal:
    return Goal(np.array([x, z]), heading_rad, "script")


@pytest.fixture
def scripted(
    explore: Callable[..., ExploreEnv], box_room: Callable[..., TriangleMesh]
) -> Callable[..., ScriptedGoals]:
    """Give `scripted([goals])`: an agent at (0, 0.5) looking along -z in a room of 4 x 4 m."""
    return lambda script, **options: ScriptedGoals(explore(box_room(), start=START), script, **options)


def walk(env: GoalWrapper, steps: int, action: Action = Action.MOVE_FORWARD) -> dict[str, Any]:
    for _ in range(steps):
        _, _, _, _, info = env.step(np.int64(action))
    return info


class RealRobot(gymnasium.Env[Any, Any]):
    """Nothing but what goal wrappers say that they need, taken from an environment of the suite."""

    def __init__(self, env: ExploreEnv) -> None:
        self.env, self.action_space, self.observation_space = env, env.action_space, env.observation_space
        self.camera, self.step_sizes = env.camera, env.step_sizes

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        return self.env.reset(seed=seed, options=options)[0], {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        return *self.env.step(action)[:4], {}


def test_environment_of_one_s_own_needs_no_more_than_is_said(
    explore: Callable[..., ExploreEnv], box_room: Callable[..., TriangleMesh]
) -> None:
    robot = RealRobot(explore(box_room(), start=START))
    env = ScriptedGoals(robot, [goal(-1.0, 0.5)])
    env.reset(seed=0)
    assert walk(env, 3)["goal_distance_m"] > 0.9
    assert env.step_sizes == pytest.approx((0.065, np.deg2rad(10.0)))
    del robot.step_sizes
    with pytest.raises(
        ValueError, match="`env` must have `step_sizes`, metres of a step forward and radians"
    ):
        ScriptedGoals(robot, [])


def test_draws_go_on_where_an_episode_has_no_seed(scripted: Callable[..., ScriptedGoals]) -> None:
    env = scripted([])

    def episodes() -> list[float]:
        drawn = []
        for seed in (0, None, None):
            env.reset(seed=seed)
            drawn.append(env.rng.random())
        return drawn

    first = episodes()
    assert len(set(first)) == 3
    assert episodes() == first


def test_observation_points_to_the_goal_and_fits_its_space(scripted: Callable[..., ScriptedGoals]) -> None:
    env = scripted([goal(-1.0, 0.5)])
    observation, info = env.reset(seed=0)
    assert observation["pointgoal_with_gps_compass"] == pytest.approx([1.0, np.pi / 2], abs=1e-6)
    assert observation["pointgoal_with_gps_compass"] == pytest.approx(pointgoal(START[:2], 0.0, (-1.0, 0.5)))
    assert env.observation_space.contains(observation)
    assert info["goal_distance_m"] == pytest.approx(1.0)
    assert info["goals_count"] == 1


def test_arrival_brings_the_next_goal(scripted: Callable[..., ScriptedGoals]) -> None:
    env = scripted([goal(0.0, 0.0), goal(1.0, 1.0)])
    env.reset(seed=0)
    assert walk(env, 4)["goals_count"] == 1
    assert walk(env, 1)["goals_count"] == 2
    assert env.goal.position_xz.tolist() == [1.0, 1.0]
    assert env.failures == []


def test_agent_with_wide_steps_arrives_where_no_step_would_bring_it_nearer(
    explore: Callable[..., ExploreEnv], box_room: Callable[..., TriangleMesh]
) -> None:
    """At 45 degrees a turn, half a turn off is as straight as it gets; so is half a step of 60 cm off."""
    script = [goal(0.0, 0.25, 0.35), goal(1.0, 1.0)]
    plain = explore(box_room(), start=START, forward_step_m=0.6, turn_step_deg=45.0)
    env = ScriptedGoals(plain, script)
    env.reset(seed=0)
    assert env.goal.position_xz.tolist() == [1.0, 1.0]
    for wrong in (goal(0.0, 0.15, 0.0), goal(0.0, 0.25, 0.5)):
        assert not env.is_reached(wrong)


def test_pose_before_an_episode_is_a_named_error(scripted: Callable[..., ScriptedGoals]) -> None:
    with pytest.raises(gymnasium.error.ResetNeeded, match="call `reset` first"):
        _ = scripted([goal(0.0, 0.0)]).position_xz


def test_goal_at_which_the_agent_stands_is_passed_over(scripted: Callable[..., ScriptedGoals]) -> None:
    env = scripted([goal(0.0, 0.6), goal(0.1, 0.5, 0.05), goal(0.0, 0.5, np.pi), goal(1.0, 1.0)])
    env.reset(seed=0)
    assert env.goal.heading_rad == np.pi
    assert [failure.reason for failure in env.failures] == [ALREADY_THERE, ALREADY_THERE]
    assert len(env.goals) == 3


def test_source_that_never_leaves_the_spot_is_not_asked_for_ever(
    scripted: Callable[..., ScriptedGoals],
) -> None:
    env = scripted([goal(0.0, 0.5)] * 50)
    env.reset(seed=0)
    assert env.goal.reason == "wander"
    assert len(env.waiting) == 50 - MAX_PROPOSALS
    assert not env.is_reached(env.goal)


def test_goal_with_a_heading_is_reached_only_when_it_is_looked_at(
    scripted: Callable[..., ScriptedGoals],
) -> None:
    env = scripted([goal(0.0, 0.5, np.deg2rad(30.0)), goal(1.0, 1.0)])
    env.reset(seed=0)
    assert walk(env, 1, Action.TURN_LEFT)["goals_count"] == 1
    assert walk(env, 1, Action.TURN_LEFT)["goals_count"] == 2


def test_goal_times_out(scripted: Callable[..., ScriptedGoals]) -> None:
    env = scripted([goal(1.5, 1.5), goal(-1.5, 1.5)])
    env.reset(seed=0)
    walk(env, 29, Action.TURN_LEFT)
    assert env.failures == []
    walk(env, 1, Action.TURN_LEFT)
    assert [failure.reason for failure in env.failures] == ["timeout"]
    assert env.goal.position_xz.tolist() == [-1.5, 1.5]


def test_unreachable_goal_is_replaced_at_once(scripted: Callable[..., ScriptedGoals]) -> None:
    env = scripted([goal(9.0, 9.0), goal(1.0, 1.0)])
    env.reset(seed=0)
    env.report_unreachable("no way")
    assert [failure.reason for failure in env.failures] == ["no way"]
    assert env.goal.position_xz.tolist() == [1.0, 1.0]


def test_review_may_change_the_goal(scripted: Callable[..., ScriptedGoals]) -> None:
    env = scripted([goal(1.5, 1.5)])
    env.reset(seed=0)
    env.review = lambda _: goal(-1.0, -1.0)
    assert walk(env, 6, Action.TURN_LEFT)["goals_count"] == 1
    assert walk(env, 1, Action.TURN_LEFT)["goals_count"] == 2
    assert env.goal.position_xz.tolist() == [-1.0, -1.0]


def test_review_may_ask_for_another_proposal(scripted: Callable[..., ScriptedGoals]) -> None:
    env = scripted([goal(1.5, 1.5), goal(0.3, -1.0)])
    env.reset(seed=0)
    env.review = lambda _: None
    walk(env, 7, Action.TURN_LEFT)
    assert env.goal.position_xz.tolist() == [0.3, -1.0]
    assert env.failures == []


def test_source_without_proposal_wanders_to_known_floor_far_from_the_trail(
    scripted: Callable[..., ScriptedGoals],
) -> None:
    env = scripted([])
    env.reset(seed=0)
    assert env.goal.reason == "wander"
    assert np.linalg.norm(env.goal.position_xz - START[:2]) > 1.5
    assert (np.abs(env.goal.position_xz) < 2.0).all()


def test_every_observation_is_mapped_and_seen(scripted: Callable[..., ScriptedGoals]) -> None:
    env = scripted([goal(1.5, 1.5)])
    env.reset(seed=0)
    walk(env, 3)
    assert env.observations == 4
    assert env.occupancy.version == 4


def test_contact_is_marked_ahead(scripted: Callable[..., ScriptedGoals]) -> None:
    env = scripted([goal(0.0, -3.0)], limits=GoalLimits(timeout_steps=99))
    env.reset(seed=0)
    before = env.occupancy.version
    assert walk(env, 40)["collided"]
    assert env.occupancy.version > before + 40


def test_compute_is_kept_outside_info(scripted: Callable[..., ScriptedGoals]) -> None:
    env = scripted([goal(1.5, 1.5)])
    env.reset(seed=0)
    info = walk(env, 2)
    assert set(env.compute_ms) == {"occupancy", "goal"}
    assert {"goal_distance_m", "goals_count"} <= set(info)
    assert all(type(value) in (bool, int, float) for value in info.values())


def test_new_episode_forgets_the_last(scripted: Callable[..., ScriptedGoals]) -> None:
    env = scripted([goal(1.5, 1.5), goal(-1.5, 1.5)])
    env.reset(seed=0)
    env.report_unreachable("no way")
    env.reset(seed=0)
    assert len(env.goals) == 1
    assert env.failures == []
    assert env.occupancy.version == 1


def test_nothing_is_known_before_reset(scripted: Callable[..., ScriptedGoals]) -> None:
    env = scripted([])
    with pytest.raises(gymnasium.error.ResetNeeded, match="no goal yet"):
        _ = env.goal
    with pytest.raises(gymnasium.error.ResetNeeded, match="no map yet"):
        _ = env.occupancy


def test_look_round_turns_once_round_before_the_next_proposal(
    scripted: Callable[..., ScriptedGoals],
) -> None:
    env = scripted([goal(0.0, -1.0), goal(1.0, 0.5)])
    env.reset(seed=0)
    env.review = lambda _: pytest.fail("a turn is not reviewed")
    env.look_round()
    env.report_unreachable("test")
    walk(env, 36, Action.TURN_LEFT)
    assert [each.reason for each in env.goals] == ["script", "sweep", "sweep", "sweep", "script"]
    assert np.abs(np.unwrap([0.0, *(each.heading_rad or 0.0 for each in env.goals[1:4])]))[
        -1
    ] == pytest.approx(2.0 * np.pi)


def test_places_near_a_failure_are_told_apart(scripted: Callable[..., ScriptedGoals]) -> None:
    env = scripted([goal(1.0, 1.0), goal(-1.0, -1.0), goal(0.0, 1.5)])
    env.reset(seed=0)
    places = [(1.0, 1.3), (-1.0, -1.3), (0.0, 0.0)]
    assert env.near_failure(places, 0.5).tolist() == [False, False, False]
    env.report_unreachable("no way")
    env.report_unreachable("no way")
    assert env.near_failure(places, 0.5).tolist() == [True, True, False]
    assert env.near_failure(places, 0.5, latest=1).tolist() == [False, True, False]
    assert env.near_failure(np.zeros((0, 2)), 0.5).shape == (0,)
    assert not env.near_failure(places, 0.0).any()


class PlainGoals(GoalWrapper):
    """Say nothing of its arguments, as a first wrapper of one's own may."""

    def __init__(self, env: gymnasium.Env[Any, Any], arrival_m: float = 0.3, *, seed: int = 0) -> None:
        super().__init__(env, limits=GoalLimits(arrival_m=arrival_m), seed=seed)

    def _begin_episode(self) -> None:
        pass

    def _propose_goal(self) -> Goal | None:
        return None

    def _review_goal(self, goal: Goal) -> Goal | None:
        return goal


class FartherGoals(PlainGoals):
    def __init__(self, env: gymnasium.Env[Any, Any], metres: float) -> None:
        super().__init__(env, 2.0 * metres)


class BonusGoals(ScriptedGoals):  # type: ignore[misc]
    """A child of a wrapper that records."""

    def __init__(self, env: gymnasium.Env[Any, Any], *, bonus: float, **others: Any) -> None:
        super().__init__(env, [])


def test_wrapper_that_records_nothing_can_be_made_again_from_its_spec() -> None:
    bare = gymnasium.make(
        "anm_gym:ANM/Explore-v0", scene="home:studio:1", camera={"width_px": 16, "height_px": 16}
    )
    (plain,) = PlainGoals(bare, 0.5).spec.additional_wrappers  # type: ignore[union-attr]
    assert plain.kwargs == {"arrival_m": 0.5, "seed": 0}
    (farther,) = FartherGoals(bare, 0.5).spec.additional_wrappers  # type: ignore[union-attr]
    assert farther.kwargs == {"metres": 0.5}
    (child,) = BonusGoals(bare, bonus=5.0, review=None).spec.additional_wrappers  # type: ignore[union-attr]
    assert child.kwargs == {"bonus": 5.0, "review": None}
    bare.close()


def test_environment_that_does_not_explore_is_refused() -> None:
    env = gymnasium.make("CartPole-v1")
    with pytest.raises(ValueError, match="`env` must have the observations of ANM/Explore-v0"):
        ScriptedGoals(env, [])
