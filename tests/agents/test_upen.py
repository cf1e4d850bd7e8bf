from collections.abc import Callable
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from agents.upen import PRESETS, UpenGoalWrapper, UpenSettings
from agents.upen_ensemble import Ensemble
from agents.upen_map import UpenMapSettings
from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.map.projection import FREE, OCCUPIED, VOID
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.grid_planning import RrtSettings

Explore = Callable[..., ExploreEnv]
QUICK = replace(
    PRESETS["paper"],
    raster=UpenMapSettings(map_m=16.0),
    tree=RrtSettings(iterations=500),
    paths=replace(PRESETS["paper"].paths, min_depth=6, max_depth=6),
)


@pytest.fixture
def upen(
    explore: Explore, two_rooms: TriangleMesh, guessing: Callable[..., Ensemble]
) -> Callable[..., UpenGoalWrapper]:
    """Give `upen(**changes)`: the quick settings, changed, in the left of two rooms."""
    ensemble = guessing(FREE, VOID)

    def build(**changes: object) -> UpenGoalWrapper:
        env = explore(two_rooms, start=(-2.0, 0.0, 0.0))
        return UpenGoalWrapper(env, settings=replace(QUICK, **changes), ensemble=ensemble)  # type: ignore[arg-type]

    return build


def test_own_predictors_come_back_with_the_environment(guessing: Callable[..., Ensemble]) -> None:
    ensemble = guessing(FREE, VOID)
    env = UpenGoalWrapper(
        gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0"), settings=QUICK, ensemble=ensemble
    )
    assert env.spec is not None
    again = gymnasium.make(env.spec)
    assert again.get_wrapper_attr("predictor") == ensemble.identity
    again.reset(seed=0)


def test_nothing_is_predicted_before_an_episode(upen) -> None:
    with pytest.raises(gymnasium.error.ResetNeeded, match="nothing has been predicted yet"):
        _ = upen().predicted_map


def turn(env: UpenGoalWrapper, steps: int) -> None:
    for _ in range(steps):
        env.step(np.int64(Action.TURN_LEFT))


def test_goal_ends_a_path_of_the_asked_length(upen) -> None:
    env = upen()
    env.reset(seed=0)
    assert env.goal.reason == "path"
    gap_m = np.linalg.norm(env.goal.position_xz - env.position_xz)
    assert 0.2 < gap_m <= 6 * 0.25 + 1e-6


def test_goal_is_not_a_predicted_obstacle(upen) -> None:
    env = upen()
    env.reset(seed=0)
    for _ in range(3):
        turn(env, 10)
        mean = env.predicted_map.mean
        row, column = env.predicted_map.frame.cells_of(env.goal.position_xz)[0]
        assert mean[:, row, column].argmax() != OCCUPIED


def test_goal_changes_every_ten_steps(upen) -> None:
    env = upen()
    env.reset(seed=0)
    turn(env, 25)
    assert len(env.goals) == 3


def test_goal_changes_with_the_metres_where_they_are_asked_for(upen) -> None:
    env = upen(replan_steps=None, replan_m=0.6)
    env.reset(seed=0)
    turn(env, 30)
    assert len(env.goals) == 1
    for _ in range(12):
        env.step(np.int64(Action.MOVE_FORWARD))
    assert len(env.goals) == 2


def test_old_goal_stays_where_no_path_is_long_enough(upen) -> None:
    env = upen()
    env.reset(seed=0)
    before = env.goal
    env.settings = replace(env.settings, paths=replace(QUICK.paths, min_depth=90, max_depth=90))
    turn(env, 20)
    assert env.goal is before
    env.report_unreachable("no way")
    assert env.goal.reason == "wander"


def test_ends_near_a_failure_are_left_out(upen) -> None:
    env = upen(blacklist_m=0.8)
    env.reset(seed=0)
    failed = env.goal.position_xz
    env.report_unreachable("no way")
    assert np.linalg.norm(env.goal.position_xz - failed) >= 0.8


def test_paths_keep_their_distance_from_predicted_obstacles(upen) -> None:
    env = upen()
    env.reset(seed=0)
    turn(env, 12)
    tight = env._blocked().sum()
    env.settings = replace(env.settings, clearance_m=0.2)
    assert 0 < tight < env._blocked().sum()


def test_same_seed_repeats_the_goals(upen) -> None:
    env, runs = upen(), []
    for _ in range(2):
        env.reset(seed=3)
        turn(env, 20)
        runs.append([goal.position_xz.tolist() for goal in env.goals])
    assert runs[0] == runs[1]


def test_released_code_differs_in_lines_points_and_certainty() -> None:
    paper, repo = PRESETS["paper"], PRESETS["repo"]
    assert (paper.paths.scoring, repo.paths.scoring) == ("paper", "repo")
    assert (repo.tree.sampling, repo.tree.iterations) == ("whole_map", 2500)
    assert repo.raster.floor == 0.0


def test_unknown_preset_lists_the_choices(
    explore: Explore, two_rooms: TriangleMesh, guessing: Callable[..., Ensemble]
) -> None:
    with pytest.raises(
        ValueError, match="unknown UPEN preset 'best'; choose one of: strong, paper, repo, metres"
    ):
        UpenGoalWrapper(explore(two_rooms), preset="best", ensemble=guessing(FREE))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"replan_steps": None}, "`replan_steps` or `replan_m` must be given, got neither"),
        ({"clearance_m": -1.0}, r"`clearance_m` must be >= 0, got -1\.0"),
    ],
)
def test_senseless_settings_are_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        UpenSettings(**options)  # type: ignore[arg-type]
