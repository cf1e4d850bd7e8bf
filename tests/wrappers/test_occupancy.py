"""The grid under rewards and observations: what it logs, and that it begins anew."""

from collections.abc import Callable

import gymnasium
import numpy as np
import pytest

from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.map.occupancy import OccupancyGrid
from anm_gym.mesh import TriangleMesh
from anm_gym.wrappers.frontier_goal import FrontierGoalWrapper
from anm_gym.wrappers.occupancy import OccupancyWrapper, has_occupancy

NEAR_THE_WALL = (0.0, -1.7, 0.0)


@pytest.fixture
def in_a_box(explore: Callable[..., ExploreEnv], box_room: Callable[..., TriangleMesh]):
    """Give `in_a_box(start)`: an agent in a room of 4 x 4 m around the origin."""
    return lambda start=(0.0, 0.0, 0.0): OccupancyWrapper(explore(box_room(), start=start))


def label_at(grid: OccupancyGrid, x: float, z: float) -> str:
    row, column = grid.frame.cells_of((x, z))[0]
    return "occupied" if grid.occupied[row, column] else "free" if grid.free[row, column] else "unknown"


def test_wall_ahead_is_occupied_floor_before_it_free_and_behind_unknown(in_a_box) -> None:
    env = in_a_box()
    env.reset(seed=0)
    assert "occupied" in {label_at(env.occupancy, 0.05, z) for z in (-1.95, -2.05)}
    assert label_at(env.occupancy, 0.05, -1.5) == "free"
    assert label_at(env.occupancy, 0.05, 0.9) == "unknown"


def test_observation_reward_and_info_are_left_alone(in_a_box) -> None:
    plain, wrapped = in_a_box().env, in_a_box()
    assert plain.reset(seed=0)[1] == wrapped.reset(seed=0)[1]
    observation, *rest = plain.step(Action.TURN_LEFT)
    again, *others = wrapped.step(Action.TURN_LEFT)
    assert rest == others
    assert all((observation[key] == again[key]).all() for key in observation)


def test_contact_out_of_view_is_logged(in_a_box) -> None:
    env = in_a_box(NEAR_THE_WALL)
    env.reset(seed=0)
    before = env.occupancy.version
    for _ in range(4):
        *_, info = env.step(Action.MOVE_FORWARD)
    assert info["collided"]
    assert env.occupancy.version > before + 4
    assert (
        label_at(env.occupancy, 0.0, float(env.unwrapped.simulator.state.position_xz[1]) - 0.15) == "occupied"
    )


def test_reset_begins_an_empty_grid(in_a_box) -> None:
    env = in_a_box()
    env.reset(seed=0)
    for _ in range(18):
        env.step(Action.TURN_LEFT)
    assert label_at(env.occupancy, 0.05, 0.9) == "free"
    env.reset(seed=0)
    assert label_at(env.occupancy, 0.05, 0.9) == "unknown"


def test_who_keeps_a_grid_is_known_before_reset(in_a_box) -> None:
    env = in_a_box()
    assert has_occupancy(env)
    assert not has_occupancy(env.env)
    assert has_occupancy(FrontierGoalWrapper(env.env))


def test_it_can_be_made_again_from_its_spec() -> None:
    env = OccupancyWrapper(gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0"), cell_m=0.2)
    again = gymnasium.make(env.spec)
    assert again.get_wrapper_attr("occupancy").cell_m == 0.2
    assert np.isclose(env.occupancy.cell_m, 0.2)
