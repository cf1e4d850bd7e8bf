"""The explorer's reward, term by term."""

from collections.abc import Callable

import gymnasium
import numpy as np
import pytest

from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.mesh import TriangleMesh
from anm_gym.wrappers.coverage_reward import CoverageRewardWrapper
from anm_gym.wrappers.occupancy import OccupancyWrapper

START = (0.0, 1.0, 0.0)
NEAR_THE_WALL = (0.0, -1.8, 0.0)


@pytest.fixture
def in_a_box(explore: Callable[..., ExploreEnv], box_room: Callable[..., TriangleMesh]):
    """Give `in_a_box(start, **env options)`: an agent in a room of 4 x 4 m, bare."""
    return lambda start=START, **options: explore(box_room(), start=start, **options)


def rewards_of(env, actions: list[Action]) -> list[float]:
    env.reset(seed=0)
    return [env.step(action)[1] for action in actions]


def test_floor_alone_is_what_explore_pays(in_a_box) -> None:
    actions = [Action.TURN_LEFT] * 5
    paid = rewards_of(CoverageRewardWrapper(in_a_box(), floor=3.0, collision=0.0, slack=0.0), actions)
    assert paid == pytest.approx([3.0 * reward for reward in rewards_of(in_a_box(), actions)])
    assert sum(paid) > 0.0


def test_every_step_costs_the_slack(in_a_box) -> None:
    env = CoverageRewardWrapper(in_a_box(reward="none"), floor=0.0, slack=0.25)
    (paid,) = rewards_of(env, [Action.TURN_LEFT])
    assert paid == -0.25


def test_contact_costs_the_penalty(in_a_box) -> None:
    env = CoverageRewardWrapper(in_a_box(NEAR_THE_WALL, reward="none"), floor=0.0, collision=0.5, slack=0.0)
    assert rewards_of(env, [Action.MOVE_FORWARD] * 3) == [0.0, -0.5, -0.5]


def test_known_cells_are_paid_by_their_area(in_a_box) -> None:
    grid = OccupancyWrapper(in_a_box(reward="none"))
    env = CoverageRewardWrapper(grid, floor=0.0, known=2.0, collision=0.0, slack=0.0)
    env.reset(seed=0)
    before = np.count_nonzero(~grid.occupancy.unknown)
    paid = env.step(Action.TURN_LEFT)[1]
    gained = np.count_nonzero(~grid.occupancy.unknown) - before
    assert gained > 0
    assert paid == pytest.approx(2.0 * 0.1**2 * gained)


def test_what_the_start_shows_is_free(in_a_box) -> None:
    env = CoverageRewardWrapper(OccupancyWrapper(in_a_box()), known=1.0, slack=0.0, collision=0.0)
    env.reset(seed=0)
    assert env.step(Action.STOP)[1] == pytest.approx(0.0, abs=1e-9)


def test_coverage_is_the_share_of_the_floor(in_a_box) -> None:
    env = CoverageRewardWrapper(in_a_box())
    _, info = env.reset(seed=0)
    assert 0.0 < info["coverage"] < 1.0
    for _ in range(36):
        *_, info = env.step(Action.TURN_LEFT)
    assert info["coverage"] == pytest.approx(
        info["explored_m2"] / env.unwrapped.simulator.grid.navigable_area_m2
    )
    assert info["coverage"] > 0.6


def test_without_explores_reward_there_is_no_coverage(in_a_box) -> None:
    _, info = CoverageRewardWrapper(in_a_box(reward="none"), floor=0.0).reset(seed=0)
    assert "coverage" not in info
    with pytest.raises(ValueError, match=r"`floor` must be 0 where .* got 1\.0; make it with reward='area'"):
        CoverageRewardWrapper(in_a_box(reward="none"))


def test_other_environments_pay_for_something_else() -> None:
    env = gymnasium.make("anm_gym:ANM/PointNav-v0", scene="home:studio:0")
    with pytest.raises(TypeError, match="`env` must be made of ANM/Explore-v0, got PointNavEnv"):
        CoverageRewardWrapper(env)


def test_grid_is_needed_to_pay_for_it(in_a_box) -> None:
    with pytest.raises(ValueError, match="`env` must have an occupancy grid for `known`; wrap it in"):
        CoverageRewardWrapper(in_a_box(), known=1.0)
