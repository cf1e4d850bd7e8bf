"""Pictures: what is drawn where."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from anm_gym.geometry import CameraSpec
from anm_gym.sim.grid import GridFrame
from anm_gym.sim.simulator import Simulator
from train.pictures import (
    FAILURE,
    FLOOR,
    OUTSIDE,
    START,
    UNSEEN,
    WALL,
    FloorPicture,
    save_picture,
    time_colors,
    write_montage,
    write_topdown,
)
from train.trajectory import Trajectory


class SimulatorOnly:
    """An environment reduced to what pictures ask of it."""

    def __init__(self, simulator, **others):
        self.attributes = {"simulator": simulator, **others}

    def get_wrapper_attr(self, name):
        return self.attributes[name]

    def has_wrapper_attr(self, name):
        return name in self.attributes


class NothingKnown:
    """An occupancy grid that knows no cell of a room around the origin."""

    frame = GridFrame((-5.0, -5.0), 0.1, (100, 100))
    free = np.zeros((100, 100), bool)


@pytest.fixture
def simulator(box_room):
    simulator = Simulator(box_room(4.0, 3.0), 0.0, CameraSpec(32, 32))
    simulator.place([0.0, 0.0], 0.0)
    return simulator


@pytest.fixture
def trajectory():
    z = np.linspace(1.0, -1.0, 9)
    poses = np.stack([np.zeros(9), z, np.zeros(9)], axis=1)
    return Trajectory("room", 0, np.ones(8, np.int8), poses, goals=np.array([[1.0, 0.0, 4.0]]))


def read(path):
    return cv2.imread(str(path))[..., ::-1]


def has_color(image, color):
    return bool((image == np.array(color)).all(axis=2).any())


def test_topdown_shows_walls_floor_start_and_trail(tmp_path, simulator, trajectory):
    image = read(write_topdown(tmp_path / "topdown.png", SimulatorOnly(simulator), trajectory))
    assert all(has_color(image, color) for color in (WALL, FLOOR, START))
    assert has_color(image, time_colors(np.array([4]), 8)[0])
    assert not has_color(image, UNSEEN)


def test_failures_are_red(tmp_path, simulator, trajectory):
    quiet = write_topdown(tmp_path / "quiet.png", SimulatorOnly(simulator), trajectory)
    given_up = replace(trajectory, failures=np.array([[-1.0, 0.5, 3.0]]))
    crossed = write_topdown(tmp_path / "crossed.png", SimulatorOnly(simulator), given_up)
    away, there = [[-1.0, -0.5, 0.0]], [[1.0, 0.5, 0.0]] * 30
    curves = {"comp_pct": np.zeros(32), "collisions": np.arange(32.0)}
    stuck = Trajectory("room", 0, np.ones(31, np.int8), np.array([*away, *there, *away]), curves=curves)
    standing = write_topdown(tmp_path / "stuck.png", SimulatorOnly(simulator), stuck)
    assert [has_color(read(path), FAILURE) for path in (quiet, crossed, standing)] == [False, True, True]


def test_floor_that_the_agent_does_not_know_is_grey(tmp_path, simulator, trajectory):
    env = SimulatorOnly(simulator, occupancy=NothingKnown())
    image = read(write_topdown(tmp_path / "topdown.png", env, trajectory))
    assert has_color(image, UNSEEN)


def test_montage_has_one_tile_per_cell(tmp_path, simulator, trajectory):
    image = read(write_montage(tmp_path / "depth.png", SimulatorOnly(simulator), trajectory, 3, 2))
    assert image.shape == (2 * 260, 3 * 260, 3)


def test_x_runs_right_and_z_runs_down():
    colors = np.full((20, 30, 3), OUTSIDE, np.uint8)
    picture = FloorPicture(colors, GridFrame((0.0, 0.0), 0.1, (20, 30)))
    picture.disc(np.array([2.0, 0.5]), 0.1, (255, 0, 0))
    rows, columns = np.nonzero((picture.image == (255, 0, 0)).all(axis=2))
    assert rows.mean() / picture.px_per_m == pytest.approx(0.5, abs=0.02)
    assert columns.mean() / picture.px_per_m == pytest.approx(2.0, abs=0.02)


def test_agent_points_along_its_heading():
    picture = FloorPicture(np.full((30, 30, 3), 255, np.uint8), GridFrame((0.0, 0.0), 0.1, (30, 30)))
    picture.arrow(np.array([1.5, 1.5]), 0.0, (255, 0, 0))
    rows, _ = np.nonzero((picture.image == (255, 0, 0)).all(axis=2))
    centre = 1.5 * picture.px_per_m
    assert centre - rows.min() > rows.max() - centre


def test_time_runs_from_dark_to_bright():
    brightness = time_colors(np.arange(11), 10).astype(float).sum(axis=1)
    assert (np.diff(brightness) > 0).all()
    assert time_colors(np.zeros(0), 10).shape == (0, 3)


def test_picture_comes_back_as_it_was_saved(tmp_path):
    picture = np.random.default_rng(0).integers(0, 256, (5, 7, 3)).astype(np.uint8)
    np.testing.assert_array_equal(read(save_picture(tmp_path / "a" / "b.png", picture)), picture)
