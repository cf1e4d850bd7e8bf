"""Seen floor against what can be worked out by hand."""

import numpy as np
import pytest

from anm_gym.envs.seen_floor import SLACK_M, STRIDE, SeenFloor
from anm_gym.geometry import CameraSpec
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.simulator import Simulator

CAMERA = CameraSpec(width_px=64, height_px=64)
LEFT = np.pi / 2


def look(
    simulator: Simulator, seen: SeenFloor, position_xz: tuple[float, float], heading_rad: float
) -> float:
    simulator.place(position_xz, heading_rad)
    return seen.look(simulator.depth_m(), simulator.state)


@pytest.fixture
def simulator(two_rooms: TriangleMesh) -> Simulator:
    return Simulator(two_rooms, 0.0, CAMERA)


def test_nothing_has_been_seen_before_the_first_look(simulator: Simulator) -> None:
    seen = SeenFloor(simulator.grid, CAMERA)
    assert seen.area_m2 == seen.fraction == 0.0
    assert seen.total_m2 == simulator.grid.component_areas_m2[0]


def test_view_across_a_room_shows_what_the_image_frames(simulator: Simulator) -> None:
    """The image cuts off the floor nearer than the sensor's height; the door lets some more through."""
    seen = SeenFloor(simulator.grid, CAMERA)
    area_m2 = look(simulator, seen, (3.8, 0.0), LEFT)
    cells = np.argwhere(simulator.grid.component == 1)
    x, z = simulator.grid.frame.centers_of(cells).T
    ahead_m = 3.8 - x
    is_framed = (ahead_m > 1.25) & (np.abs(z) < ahead_m)
    behind_wall = (x < 0.0) & (np.abs(z) / ahead_m > 0.5 / 3.8)
    expected_m2 = (is_framed & ~behind_wall).sum() * simulator.grid.frame.cell_m**2
    assert area_m2 == pytest.approx(expected_m2, rel=0.06)


def test_same_view_adds_nothing(simulator: Simulator) -> None:
    seen = SeenFloor(simulator.grid, CAMERA)
    first_m2 = look(simulator, seen, (2.0, 0.0), 0.0)
    assert first_m2 > 0.0
    assert look(simulator, seen, (2.0, 0.0), 0.0) == 0.0
    assert seen.area_m2 == pytest.approx(first_m2)


def test_other_room_is_seen_through_the_door_only(simulator: Simulator) -> None:
    """From (1, 1.8) the edge of the door at (0, 0.5) bounds the view by z = 0.5 + 1.3 x."""
    seen = SeenFloor(simulator.grid, CAMERA)
    for heading_rad in np.arange(-3.0, 3.2, 0.3):
        look(simulator, seen, (1.0, 1.8), float(heading_rad))
    x, z = simulator.grid.frame.centers_of(STRIDE * np.argwhere(seen.is_seen)).T
    assert (x < -1.0).any()
    assert (z - (0.5 + 1.3 * x))[x < 0.0].max() < 0.1


def test_turning_round_everywhere_shows_all_floor(simulator: Simulator) -> None:
    seen = SeenFloor(simulator.grid, CAMERA)
    added_m2 = sum(
        look(simulator, seen, (x, z), float(heading_rad))
        for x in (-3.8, -2.0, -0.2, 0.2, 2.0, 3.8)
        for z in (-1.8, 0.0, 1.8)
        for heading_rad in np.arange(-np.pi, np.pi, np.pi / 4)
    )
    assert seen.fraction == 1.0
    assert added_m2 == pytest.approx(seen.total_m2)


def test_empty_pixels_show_nothing(simulator: Simulator) -> None:
    seen = SeenFloor(simulator.grid, CAMERA)
    simulator.place((2.0, 0.0), 0.0)
    assert seen.look(np.zeros((64, 64), np.float32), simulator.state) == 0.0


@pytest.mark.parametrize("sensor_height_m", [0.1, 0.3, 1.25])
def test_foot_of_a_wall_does_not_show_the_floor_behind_it(
    two_rooms: TriangleMesh, sensor_height_m: float
) -> None:
    """A low camera sees the wall, up to where the body would step over it, in front of much floor."""
    camera = CameraSpec(sensor_height_m=sensor_height_m)
    simulator = Simulator(two_rooms, 0.0, camera)
    seen = SeenFloor(simulator.grid, camera)
    assert look(simulator, seen, (3.0, 1.8), LEFT) > 0.0
    x, z = simulator.grid.frame.centers_of(STRIDE * np.argwhere(seen.is_seen)).T
    is_hidden = (x < 0.0) & (z > 0.5 + 1.3 / 3.0 * x + 0.2)
    assert x[is_hidden].min(initial=0.0) > -SLACK_M - 0.15, "a pixel's row, and the thinnest of walls"
    assert (x[~is_hidden] < -1.0).any(), "the door lets some through"
