from collections.abc import Callable

import numpy as np
import pytest

from agents.predicted_floor import PredictedFloor
from agents.upen_ensemble import Ensemble
from agents.upen_map import UpenMapSettings
from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.map.projection import VOID
from anm_gym.mesh import TriangleMesh
from anm_gym.wrappers.frontier_goal import FrontierGoalWrapper


@pytest.fixture
def source(guessing: Callable[..., Ensemble]) -> PredictedFloor:
    return PredictedFloor(guessing(VOID, VOID), UpenMapSettings(map_m=16.0, floor=0.0))


def test_frontiers_are_searched_in_the_prediction(
    explore: Callable[..., ExploreEnv], two_rooms: TriangleMesh, source: PredictedFloor
) -> None:
    env = FrontierGoalWrapper(explore(two_rooms, start=(-2.0, 0.0, 0.0)), preset="upen-repo", source=source)
    env.reset(seed=0)
    for _ in range(12):
        env.step(np.int64(Action.TURN_LEFT))
    frame, free, unknown = source.floor()
    assert not (free & unknown).any()
    assert frame.cell_m == 0.1
    assert frame.shape[0] < 80
    row, column = frame.cells_of(env.goal.position_xz)[0]
    assert free[row, column]
    assert unknown[row - 1 : row + 2, column - 1 : column + 2].any()
    assert env.stopwatch.compute_ms["predict"] > 0.0
    assert env.map_identity == source.identity


def test_episode_forgets_the_last_one(
    explore: Callable[..., ExploreEnv], two_rooms: TriangleMesh, source: PredictedFloor
) -> None:
    env = FrontierGoalWrapper(explore(two_rooms, start=(-2.0, 0.0, 0.0)), preset="upen-repo", source=source)
    floors = []
    for _ in range(2):
        env.reset(seed=0)
        env.step(np.int64(Action.TURN_LEFT))
        floors.append(source.floor())
    assert floors[0][0] == floors[1][0]
    assert (floors[0][1] == floors[1][1]).all()


def test_floor_before_an_episode_is_refused(source: PredictedFloor) -> None:
    with pytest.raises(ValueError, match="must see an episode begin first; call `begin`"):
        source.floor()
