"""The way out for a lost agent: through a gap that the wide wave shuts, not through walls."""

import numpy as np
import pytest

from agents.ego_memory import OCCUPIED, EgoMemory
from agents.navigator_net import NavigatorNetSettings
from agents.way_out import NUM_HEADINGS, WayOutSettings, prices
from anm_gym.geometry import CameraSpec, camera_pose

CAMERA = CameraSpec(width_px=64, height_px=64)
POSE = camera_pose((0.0, 1.25, 0.0), 0.0)[None].astype(np.float32)
GOAL = np.array([[0.0, -4.0]], np.float32)
ONE = np.array([0])
AHEAD = {*range(4), *range(NUM_HEADINGS - 3, NUM_HEADINGS)}


def wall(along_m: float, left_m: float, right_m: float) -> np.ndarray:
    """(1, 64, 64) depth of a wall ahead that is open between two offsets to the right."""
    across_m = along_m * CAMERA.directions[0, :, 0]
    image = np.where((across_m > left_m) & (across_m < right_m), 6.0, along_m)
    return np.broadcast_to(image, (1, 64, 64)).astype(np.float32)


def remembering(depth_m: np.ndarray) -> EgoMemory:
    """Memory of an agent at the origin that looks along -z, to a goal 4 m ahead."""
    memory, one = EgoMemory(1, CAMERA, NavigatorNetSettings().at_work().memory), np.ones(1, np.float32)
    memory.update(depth_m, POSE, 1.25 * one, ONE, 0.25 * one)
    memory.waves(POSE, GOAL)
    return memory


def test_gap_that_the_wide_wave_shuts_is_a_way() -> None:
    """Thirty centimetres, off the borders of the wide wave's cells, in a wall of 4 m."""
    memory = remembering(wall(2.0, 0.45, 0.75))
    assert memory._wave.at(POSE[:, None, [0, 2], 3])[0, 0] > 5.5
    ahead_m = memory.ahead(POSE, ONE)[0]
    assert ahead_m.min() < 4.8
    assert int(ahead_m.argmin()) in AHEAD


def walled_in(points_xz: np.ndarray, position_xz: tuple[float, float], goal: np.ndarray) -> np.ndarray:
    """Distances ahead of an agent that knows of surfaces at some points."""
    memory = EgoMemory(1, CAMERA, NavigatorNetSettings().at_work().memory)
    memory._mark(np.zeros(len(points_xz), int), points_xz.astype(np.float32), OCCUPIED)
    x, z = position_xz
    pose = camera_pose((x, 1.25, z), 0.0)[None].astype(np.float32)
    memory.waves(pose, goal.astype(np.float32))
    return memory.ahead(pose, ONE)[0]


def along_x(low_m: float, high_m: float, z_m: float) -> np.ndarray:
    x_m = np.arange(low_m, high_m, 0.05)
    return np.stack([x_m, np.full_like(x_m, z_m)], axis=1)


@pytest.mark.parametrize("along_m", [0.15, 0.2, 0.3, 0.35, 0.45, 0.7])
@pytest.mark.parametrize("half_width_m", [1.5, 3.0])
def test_nobody_is_led_into_a_wall(along_m: float, half_width_m: float) -> None:
    """The wall hides the goal, and its ends must be made for, even though all behind it is nearer."""
    wall_xz = along_x(-half_width_m, half_width_m, -along_m)
    ahead_m = walled_in(wall_xz, (0.03, 0.02), np.array([[0.0, -2.0]]))
    direction = int(ahead_m.argmin()) * 360 // NUM_HEADINGS
    assert 60 <= direction <= 300


def test_walls_beyond_the_fine_window_count() -> None:
    """The wall is 4 m ahead, and open far to the left only."""
    ahead_m = walled_in(along_x(-3.0, 9.0, -4.05), (0.0, 0.0), np.array([[0.5, -6.0]]))
    assert 10 <= int(ahead_m.argmin()) * 360 // NUM_HEADINGS <= 90


def test_agents_are_led_by_what_they_remember_themselves() -> None:
    settings = NavigatorNetSettings().at_work().memory
    together, alone = EgoMemory(3, CAMERA, settings), [EgoMemory(1, CAMERA, settings) for _ in range(3)]
    poses = np.stack([camera_pose((0.4 * agent, 1.25, 0.0), 0.0) for agent in range(3)]).astype(np.float32)
    goals = np.array([[0.0, -4.0], [3.0, -1.0], [-2.0, 2.0]], np.float32)
    depth_m = np.concatenate([wall(along_m, -0.2, 0.3) for along_m in (0.6, 1.0, 1.4)])
    three = np.ones(3, np.float32)
    together.update(depth_m, poses, 1.25 * three, np.zeros(3, int), 0.25 * three)
    together.waves(poses, goals)
    for agent, memory in enumerate(alone):
        one = np.s_[agent : agent + 1]
        memory.update(depth_m[one], poses[one], 1.25 * three[one], ONE, 0.25 * three[one])
        memory.waves(poses[one], goals[one])
    some = np.array([2, 0])
    expected = [alone[agent].ahead(poses[agent : agent + 1], ONE)[0] for agent in some]
    np.testing.assert_array_equal(together.ahead(poses[some], some), expected)


def test_headings_are_counted_to_the_left() -> None:
    """The gap is far to the left, so the way ahead is shorter there."""
    ahead_m = remembering(wall(1.0, -0.95, -0.45)).ahead(POSE, ONE)[0]
    assert 0 < int(ahead_m.argmin()) < NUM_HEADINGS // 2


def test_prices_follow_what_is_known() -> None:
    occupied, touched, visited = np.zeros((3, 1, 7, 7), bool)
    occupied[0, 3, 3] = occupied[0, 0, 0] = visited[0, 0, 0] = touched[0, 3, 4] = touched[0, 6, 6] = True
    settings = WayOutSettings()
    price_m = prices(occupied, touched, visited, 0.1, settings)[0]
    expected = {
        (3, 3): settings.blocked_cost,
        (0, 0): 1.0,
        (3, 4): settings.contact_cost,
        (6, 6): settings.contact_cost,
        (2, 3): settings.beside_cost,
        (2, 2): 1.0,
    }
    assert {cell: price_m[cell] for cell in expected} == pytest.approx(
        {cell: 0.1 * cost for cell, cost in expected.items()}
    )
