"""The way out for a lost agent: through a gap that the wide wave shuts, not through walls."""

import numpy as np
import pytest

from agents.ego_memory import EgoMemory, EgoMemorySettings
from agents.way_out import NUM_HEADINGS, WayOutSettings, prices
from anm_gym.geometry import CameraSpec, camera_pose

CAMERA = CameraSpec(width_px=64, height_px=64)
GOAL = np.array([[0.0, -4.0]], np.float32)


def wall_with_gap(left_m: float, right_m: float) -> np.ndarray:
    """(1, 64, 64) depth of a wall 1 m ahead that is open between two offsets to the right."""
    across_m = CAMERA.directions[0, :, 0]
    image = np.where((across_m > left_m) & (across_m < right_m), 6.0, 1.0)
    return np.broadcast_to(image, (1, 64, 64)).astype(np.float32)


def led(depth_m: np.ndarray) -> np.ndarray:
    """Distances ahead of an agent at the origin that looks along -z, to a goal 4 m ahead."""
    memory, pose = EgoMemory(1, CAMERA), camera_pose((0.0, 1.25, 0.0), 0.0)[None].astype(np.float32)
    one = np.ones(1, np.float32)
    memory.update(depth_m, pose, 1.25 * one, np.zeros(1, int), 0.25 * one)
    memory.waves(pose, GOAL)
    return memory.ahead(pose, np.array([0]))[0]


def test_gap_of_forty_centimetres_is_a_way() -> None:
    ahead_m = led(wall_with_gap(-0.05, 0.35))
    assert int(ahead_m.argmin()) in (*range(4), *range(NUM_HEADINGS - 4, NUM_HEADINGS))
    assert ahead_m.min() < 4.3


def test_closed_wall_is_gone_round() -> None:
    """The view ends a metre to either side, and so does the wall for all that is known."""
    assert led(wall_with_gap(9.0, 9.0)).min() > 4.7


def test_headings_are_counted_to_the_left() -> None:
    """The gap is far to the left, so the way ahead is shorter there."""
    ahead_m = led(wall_with_gap(-0.95, -0.45))
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


def test_no_lost_agents_need_no_way_out() -> None:
    memory = EgoMemory(2, CAMERA, EgoMemorySettings())
    assert memory.ahead(np.zeros((0, 4, 4), np.float32), np.zeros(0, int)).shape == (0, NUM_HEADINGS)
