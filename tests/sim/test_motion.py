import numpy as np
import pytest

from anm_gym.geometry import forward_xz
from anm_gym.sim.grid import GridFrame
from anm_gym.sim.motion import move_forward
from anm_gym.sim.traversable import BodySpec, TraversableGrid

LEFT, RIGHT = np.pi / 2, -np.pi / 2


@pytest.fixture
def room(box_room):
    return TraversableGrid.from_mesh(box_room(), 0.0)


def walk(grid, position_xz, heading_rad, steps, step_m=0.065):
    for _ in range(steps):
        motion = move_forward(grid, position_xz, heading_rad, step_m)
        position_xz = motion.position_xz
    return motion


@pytest.mark.parametrize("heading_rad", [0.0, LEFT, RIGHT, np.pi, 0.7, -2.1])
def test_a_free_step_has_its_length_and_direction(room, heading_rad):
    start = np.array([0.2, -0.1])
    motion = move_forward(room, start, heading_rad, 0.065)
    np.testing.assert_allclose(motion.position_xz, start + 0.065 * forward_xz(heading_rad))
    assert motion.travelled_m == pytest.approx(0.065)
    assert not motion.collided


@pytest.mark.parametrize("heading_rad", [0.0, LEFT, RIGHT, np.pi])
def test_contact_is_where_the_clearance_is_the_radius(room, heading_rad):
    motion = walk(room, np.array([0.013, -0.021]), heading_rad, 40)
    assert motion.collided
    assert room.clearance_at(motion.position_xz) == pytest.approx(0.1, abs=1e-5)
    assert np.abs(motion.position_xz).max() == pytest.approx(2.0 - 0.1, abs=0.05), "half a cell either side"


def test_the_last_move_is_partial(room):
    start = walk(room, np.array([0.0, 0.0]), RIGHT, 100).position_xz - [0.03, 0.0]
    motion = move_forward(room, start, RIGHT, 0.065)
    assert motion.collided
    assert motion.travelled_m == pytest.approx(0.03, abs=1e-5)
    assert np.linalg.norm(motion.position_xz - start) == pytest.approx(motion.travelled_m)


def test_a_body_in_contact_does_not_slide(room):
    touching = walk(room, np.array([0.0, 0.0]), RIGHT, 100).position_xz
    motion = walk(room, touching, RIGHT + 0.4, 20)
    assert motion.collided
    np.testing.assert_allclose(motion.position_xz, touching, atol=1e-4)


def test_a_body_in_contact_can_leave(room):
    touching = walk(room, np.array([0.0, 0.0]), RIGHT, 100).position_xz
    motion = move_forward(room, touching, LEFT, 0.065)
    assert not motion.collided
    assert motion.travelled_m == pytest.approx(0.065)


def test_a_long_step_does_not_jump_over_a_thin_wall(two_rooms):
    grid = TraversableGrid.from_mesh(two_rooms, 0.0)
    motion = move_forward(grid, np.array([-1.0, 1.2]), RIGHT, 2.0)
    assert motion.collided
    assert motion.position_xz[0] < -0.05


def test_a_body_does_not_squeeze_between_cells_that_touch_at_a_corner():
    clearance = np.zeros((8, 8), np.float32)
    clearance[1:4, 1:4] = clearance[4:7, 4:7] = 0.12
    component = (clearance > 0).astype(np.int32)
    component[4:7, 4:7] = 2
    frame = GridFrame((0.0, 0.0), 0.05, (8, 8))
    grid = TraversableGrid(frame, BodySpec(), component > 0, component == 0, clearance, component)
    motion = walk(grid, np.array([0.1, 0.1]), -3 * np.pi / 4, 5)
    assert motion.collided
    assert grid.component_at(motion.position_xz) == 1


def test_a_step_of_no_length_changes_nothing(room):
    motion = move_forward(room, np.array([0.3, 0.4]), 1.0, 0.0)
    assert (motion.travelled_m, motion.collided) == (0.0, False)
    assert motion.position_xz.tolist() == [0.3, 0.4]
