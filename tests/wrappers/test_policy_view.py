"""What a policy sees: the map turns with the agent, and both images are what Stable-Baselines3 convolves."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.geometry import camera_pose
from anm_gym.map.occupancy import OccupancyGrid, OccupancySettings
from anm_gym.mesh import TriangleMesh
from anm_gym.wrappers.frontier_goal import FrontierGoalWrapper
from anm_gym.wrappers.occupancy import OccupancyWrapper
from anm_gym.wrappers.policy_view import MAP_CHANNELS, PolicyViewWrapper, depth_image, ego_map

OCCUPIED, FREE, STOOD = range(3)
OFFSETS_M = 0.1 * (np.arange(40) - 19.5)


@pytest.fixture
def in_a_box(explore: Callable[..., ExploreEnv], box_room: Callable[..., TriangleMesh]):
    """Give `in_a_box(start)`: an agent in a room of 4 x 4 m with an occupancy grid."""
    return lambda start=(0.0, 0.0, 0.0): OccupancyWrapper(explore(box_room(), start=start))


def spot(x: float, z: float) -> OccupancyGrid:
    """Give a grid of one contact."""
    grid = OccupancyGrid(floor_y_m=0.0, settings=OccupancySettings(cell_m=0.1))
    grid.mark_blocked((x, z))
    return grid


@pytest.mark.parametrize(
    ("heading_rad", "row", "column"),
    [(0.0, 10, 25), (np.pi / 2, 25, 29), (np.pi, 29, 14), (-np.pi / 2, 14, 10)],
)
def test_place_moves_through_the_map_as_the_agent_turns(heading_rad: float, row: int, column: int) -> None:
    """0.95 m ahead and 0.55 m to the right of an agent that looks along -z, seen at four headings."""
    grid = spot(0.55, -0.95)
    seen = ego_map(grid, camera_pose((0.0, 1.25, 0.0), heading_rad), OFFSETS_M)
    assert seen.shape == (len(MAP_CHANNELS), 40, 40)
    assert np.argwhere(seen[OCCUPIED]).tolist() == [[row, column]]


def test_room_ahead_is_drawn_above_the_middle(in_a_box) -> None:
    env = PolicyViewWrapper(in_a_box((0.0, 0.5, 0.0)), map_px=60, pixel_m=0.1)
    seen = env.reset(seed=0)[0]["ego_map"]
    middle = slice(27, 33)
    assert (seen[FREE, 20, middle] == 255).all()
    assert (seen[:, 40, middle] == 0).all()
    wall_row = np.flatnonzero(seen[OCCUPIED, :, 30])
    assert wall_row.tolist() == pytest.approx([4.5], abs=1.0)
    assert seen[STOOD, 29:31, 29:31].max() == 255


def test_trail_is_behind_an_agent_that_walked(in_a_box) -> None:
    env = PolicyViewWrapper(in_a_box((0.0, 1.5, 0.0)), map_px=40, pixel_m=0.1)
    env.reset(seed=0)
    for _ in range(15):
        observation, *_ = env.step(Action.MOVE_FORWARD)
    stood = observation["ego_map"][STOOD]
    assert (stood[21:28, 19:21].max(axis=1) == 255).all()
    assert stood[:17].max() == 0


def test_what_lies_beyond_the_grid_is_unknown() -> None:
    seen = ego_map(spot(0.0, 0.0), camera_pose((50.0, 1.25, -80.0), 0.3), OFFSETS_M)
    assert seen.max() == 0


def test_depth_is_averaged_into_bytes() -> None:
    depth_m = np.zeros((8, 8, 1), np.float32)
    depth_m[:4, :4], depth_m[:4, 4:], depth_m[4:, :2] = 10.0, 2.0, 5.0
    assert depth_image(depth_m, 2, 10.0).tolist() == [[[255, 51], [128, 0]]], "what is empty has no depth"


def test_only_what_is_asked_for_is_observed(in_a_box) -> None:
    env = PolicyViewWrapper(in_a_box(), map_px=0, depth_px=16, keys=("gps",))
    observation, _ = env.reset(seed=0)
    assert set(observation) == {"depth_image", "gps"}
    assert env.observation_space.contains(observation)
    assert env.observation_space.contains(env.step(Action.MOVE_FORWARD)[0])


def test_images_are_what_stable_baselines_convolves(in_a_box) -> None:
    from stable_baselines3.common.preprocessing import is_image_space, is_image_space_channels_first

    spaces: Any = PolicyViewWrapper(in_a_box(), map_px=48, depth_px=36).observation_space
    assert all(is_image_space(space) and is_image_space_channels_first(space) for space in spaces.values())


def test_observations_are_fresh_arrays(in_a_box) -> None:
    env = PolicyViewWrapper(in_a_box())
    first, _ = env.reset(seed=0)
    kept = {key: value.copy() for key, value in first.items()}
    env.step(Action.TURN_LEFT)
    assert all((first[key] == kept[key]).all() for key in kept)


def test_grid_of_a_goal_wrapper_will_do(in_a_box) -> None:
    goals = FrontierGoalWrapper(in_a_box().env)
    env = PolicyViewWrapper(goals, keys=("pointgoal_with_gps_compass",))
    observation, _ = env.reset(seed=0)
    assert observation["ego_map"][FREE].max() == 255
    assert env.observation_space.contains(observation)


def test_map_needs_a_grid(in_a_box) -> None:
    with pytest.raises(ValueError, match="`env` must have an occupancy grid; wrap it in OccupancyWrapper"):
        PolicyViewWrapper(in_a_box().env)


def test_impossible_views_are_refused(in_a_box) -> None:
    with pytest.raises(ValueError, match="`map_px` and `depth_px` must be >= 0 and `pixel_m` > 0, got -1"):
        PolicyViewWrapper(in_a_box(), map_px=-1)
    with pytest.raises(ValueError, match="must leave something to see"):
        PolicyViewWrapper(in_a_box(), map_px=0, depth_px=0)
    with pytest.raises(TypeError, match="`keys` must be a list of names, got 'gps'"):
        PolicyViewWrapper(in_a_box(), keys="gps")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="`keys` must be observed below, got smell"):
        PolicyViewWrapper(in_a_box(), keys=("smell",))
