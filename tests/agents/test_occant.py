from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from agents.goal_net import GoalNetSettings
from agents.layout_memory import EXPLORED, OCCUPIED, LayoutSettings
from agents.navigators import make_navigator
from agents.occant import LOOK_ROUND_REASON, PRESETS, OccAntGoalWrapper
from agents.occant_model import (
    Anticipator,
    OccAntModel,
    OccAntSettings,
    new_anticipator_net,
    new_goal_net,
    save_model,
)
from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.map.reach import ReachableSpace
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.grid import GridFrame

Explore = Callable[..., ExploreEnv]
FACING_THE_DOOR = (-2.0, 0.0, -np.pi / 2)
"""Start in the left room with the door ahead."""
DRAWS = replace(PRESETS["steps"], samples=True)
SMALL = OccAntSettings(
    width=2,
    goal_net=GoalNetSettings(widths=(4,), kernels=(3, 3)),
    layout=LayoutSettings(map_cells=200, view_cells=16),
)


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Callable[[bool], str]:
    """Give `weights(anticipation)`: a file of an untrained model."""
    folder = tmp_path_factory.mktemp("weights")

    def path_of(anticipation: bool) -> str:
        settings = replace(SMALL, anticipates=anticipation)
        anticipator = Anticipator(new_anticipator_net(settings, 0)) if anticipation else None
        path = folder / f"{anticipation}.safetensors"
        save_model(OccAntModel(settings, new_goal_net(settings, 0), anticipator), path)
        return str(path)

    return path_of


@pytest.fixture
def occant(explore: Explore, two_rooms: TriangleMesh, weights: Callable[[bool], str]):
    """Give `occant(anticipation, **options)`: a wrapper that was reset in the left room."""

    def build(anticipation: bool, **options) -> OccAntGoalWrapper:
        env = OccAntGoalWrapper(
            explore(two_rooms, start=FACING_THE_DOOR),
            anticipation=anticipation,
            weights=weights(anticipation),
            **({"preset": "steps"} | options),
        )
        env.reset(seed=0)
        return env

    return build


def prefer(env: OccAntGoalWrapper, offset_xz: tuple[float, float]) -> None:
    """Let the policy like the goal best that lies so far from the agent, in the frame of the start."""

    def score_goals(_: np.ndarray) -> np.ndarray:
        pose = env._local_pose
        points = np.stack([env.memory.goal_xz(goal, pose) for goal in range(256)])
        return -np.linalg.norm(points - pose[:2] - offset_xz, axis=1).astype(np.float32)

    env._model.score_goals = score_goals  # type: ignore[method-assign]


def decide(env: OccAntGoalWrapper, offset_xz: tuple[float, float]) -> None:
    """Let the policy decide now."""
    prefer(env, offset_xz)
    env._goal_age = env.settings.interval_steps
    env._replace_goal()


def test_map_without_anticipation_holds_what_was_seen(occant) -> None:
    env = occant(False)
    row, column = env.memory.frame.cells_of([0.0, -1.5])[0]
    assert env.memory.grid.probabilities[EXPLORED, row, column] == 1.0
    assert env.memory.grid.probabilities[OCCUPIED, row, column] == 0.0
    assert not env.memory.grid.is_known[env.memory.frame.shape[0] // 2 + 5 :].any()


def test_anticipation_decides_what_the_map_holds(occant) -> None:
    env = occant(True)
    env._model.anticipator = np.ones_like
    env.reset(seed=0)
    assert env.memory.grid.is_known.sum() == pytest.approx(64 * 64, rel=0.05)
    assert env.memory.grid.probabilities[OCCUPIED].max() == 1.0


def test_goal_lies_where_the_policy_puts_it(occant) -> None:
    env = occant(False)
    decide(env, (0.0, -1.5))
    # Ahead of the start is along +x.
    assert env.goal.reason == "policy"
    assert env.goal.position_xz == pytest.approx([-0.5, 0.0], abs=0.3)


def test_goal_beyond_a_closed_room_is_moved_to_where_one_can_stand(
    explore: Explore, box_room: Callable[..., TriangleMesh], weights: Callable[[bool], str]
) -> None:
    env = OccAntGoalWrapper(
        explore(box_room(), start=(0.0, 0.0, 0.0)), anticipation=False, weights=weights(False)
    )
    env.reset(seed=0)
    for _ in range(36):
        env.step(np.int64(Action.TURN_LEFT))
    decide(env, (0.0, -3.0))
    assert env.goal.reason == "policy"
    assert env.get_wrapper_attr("simulator").grid.is_navigable(env.goal.position_xz)
    assert env.goal.position_xz[1] < -1.5


def test_goal_of_a_caught_agent_lies_outside_of_what_it_can_reach(occant, monkeypatch) -> None:
    env = occant(False)
    cost_m = np.full((5, 5), np.inf)
    cost_m[2, 2] = 0.0
    own_cell = ReachableSpace(GridFrame(tuple(env.position_xz - 0.125), 0.05, (5, 5)), cost_m)
    monkeypatch.setattr("agents.occant.reachable_space", lambda *_: own_cell)
    before = len(env.failures)
    decide(env, (0.0, -1.5))
    assert env.goal.position_xz == pytest.approx([-0.5, 0.0], abs=0.3)
    assert len(env.failures) == before


def test_goal_stands_for_25_steps(occant) -> None:
    env = occant(False)
    decide(env, (0.0, -3.0))
    first = env.goal
    for _ in range(24):
        env.step(np.int64(Action.TURN_LEFT))
        assert env.goal is first
    env.step(np.int64(Action.TURN_LEFT))
    assert env.goal is not first


def test_agent_looks_round_at_a_goal_that_it_reaches_early(occant) -> None:
    env = occant(False)
    decide(env, (0.0, -0.4))
    for _ in range(6):
        env.step(np.int64(Action.MOVE_FORWARD))
    assert env.goal.reason == LOOK_ROUND_REASON
    assert env.goal.heading_rad is not None


def test_metres_preset_counts_the_way_and_decides_on_arrival(occant) -> None:
    assert PRESETS["metres"].interval_m == pytest.approx(6.25)
    env = occant(False, settings=replace(PRESETS["metres"], interval_m=0.5))
    decide(env, (0.0, -3.0))
    first = env.goal
    for _ in range(7):
        env.step(np.int64(Action.MOVE_FORWARD))
        assert env.goal is first
    env.step(np.int64(Action.MOVE_FORWARD))
    assert env.goal is not first
    decide(env, (0.0, 0.0))
    env.step(np.int64(Action.TURN_LEFT))
    assert env.goal.reason == "policy"


def test_goal_that_failed_is_passed_over(occant) -> None:
    env = occant(False)
    decide(env, (0.0, -1.5))
    failed = env.goal.position_xz
    env.report_unreachable("no way")
    assert env.goal.reason == "policy"
    assert np.linalg.norm(env.goal.position_xz - failed) >= env.settings.blacklist_m


def test_drawn_goals_follow_the_seed(occant) -> None:
    drawn = [
        [goal.position_xz.tolist() for goal in occant(False, seed=seed, settings=DRAWS).goals]
        for seed in (1, 1, 2)
    ]
    assert drawn[0] == drawn[1]
    assert drawn[0] != drawn[2]


@pytest.mark.parametrize("anticipation", [True, False])
def test_episode_replays_under_its_seed(occant, anticipation: bool) -> None:
    env = occant(anticipation)
    policy = make_navigator("planner", env)
    episodes = []
    for _ in range(2):
        observation, _ = env.reset(seed=4)
        actions: list[int] = []
        for step in range(40):
            action, _ = policy.predict(observation, None, np.array([step == 0]))
            actions.append(int(action))
            observation, *_ = env.step(np.int64(action))
        episodes.append(actions)
    assert episodes[0] == episodes[1]
    assert Action.STOP not in episodes[0]


@pytest.mark.parametrize(
    ("forward_step_m", "turn_step_deg", "every"), [(0.065, 10.0, 5), (0.25, 10.0, 2), (0.065, 30.0, 2)]
)
def test_wider_steps_and_turns_bring_more_looks(
    explore: Explore,
    two_rooms: TriangleMesh,
    weights,
    forward_step_m: float,
    turn_step_deg: float,
    every: int,
) -> None:
    env = OccAntGoalWrapper(
        explore(two_rooms, forward_step_m=forward_step_m, turn_step_deg=turn_step_deg), weights=weights(True)
    )
    env.reset(seed=0)
    looks: list[int] = []
    add = env.memory.add
    env.memory.add = lambda *arguments: (looks.append(env._num_frames), add(*arguments))
    for _ in range(10):
        env.step(Action.TURN_LEFT)
    assert looks == list(range(every, 11, every))


def test_weights_must_fit_the_anticipation(explore: Explore, two_rooms: TriangleMesh, weights) -> None:
    with pytest.raises(ValueError, match="`weights` must be of a model with anticipation True, got False"):
        OccAntGoalWrapper(explore(two_rooms), anticipation=True, weights=weights(False))


def test_unknown_preset_lists_the_choices(explore: Explore, two_rooms: TriangleMesh) -> None:
    with pytest.raises(ValueError, match="unknown OccAnt preset 'weak'; choose one of: steps, metres"):
        OccAntGoalWrapper(explore(two_rooms), preset="weak")


def test_interval_must_be_positive() -> None:
    with pytest.raises(ValueError, match="`interval_steps` must be >= 1, got 0"):
        replace(PRESETS["steps"], interval_steps=0)
