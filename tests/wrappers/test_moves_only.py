"""Three actions that are the three moves."""

from collections.abc import Callable

import numpy as np
import pytest

from anm_gym.actions import MOVES
from anm_gym.envs.explore import ExploreEnv
from anm_gym.mesh import TriangleMesh
from anm_gym.wrappers.moves_only import MovesOnlyWrapper


@pytest.mark.parametrize("number", range(len(MOVES)))
def test_each_number_is_a_move(
    explore: Callable[..., ExploreEnv], box_room: Callable[..., TriangleMesh], number: int
) -> None:
    plain, moves = (explore(box_room(), start=(0.0, 0.0, 0.0)) for _ in range(2))
    env = MovesOnlyWrapper(moves)
    plain.reset(seed=0)
    env.reset(seed=0)
    expected, *_ = plain.step(MOVES[number])
    observation, _, terminated, *_ = env.step(np.int64(number))
    assert not terminated
    assert (observation["world_from_camera"] == expected["world_from_camera"]).all()


def test_there_is_no_stop(explore: Callable[..., ExploreEnv], box_room: Callable[..., TriangleMesh]) -> None:
    assert MovesOnlyWrapper(explore(box_room())).action_space.n == 3


@pytest.mark.parametrize("number", [-1, 3])
def test_number_that_is_no_move_is_an_error(
    explore: Callable[..., ExploreEnv], box_room: Callable[..., TriangleMesh], number: int
) -> None:
    env = MovesOnlyWrapper(explore(box_room()))
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"`action` must be one of \[0, 1, 2\]"):
        env.step(np.int64(number))
