from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from agents.upen_ensemble import EnsembleSettings
from anm_gym.geometry import wrap_angle
from anm_gym.map.grid_fusion import FloorPose, ego_frame
from anm_gym.map.projection import FREE, OCCUPIED, VOID
from anm_gym.scenes.catalog import make_scene
from anm_gym.scenes.scene import Scene
from anm_gym.sim.simulator import Simulator
from train.upen.data import (
    FIRST_TRAINING_SEED,
    Crops,
    CropSettings,
    TrueClasses,
    class_shares,
    crops_of,
    gather,
    test_homes,
    training_homes,
    walk,
)

HOME = "home:studio:3"
RASTER = EnsembleSettings(crop_cells=32)
TINY = CropSettings(crops_per_home=6, min_steps=8, max_steps=16, image_px=32)

test_homes.__test__ = False  # type: ignore[attr-defined]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return make_scene(HOME)


@pytest.fixture(scope="module")
def simulator(scene: Scene) -> Simulator:
    return Simulator(scene.storey_mesh, scene.floor_y_m)


@pytest.fixture(scope="module")
def crops() -> Crops:
    return gather(HOME, RASTER, TINY, seed=0)


def test_homes_to_learn_from_are_not_those_to_evaluate_on() -> None:
    learned, tested = training_homes(40), test_homes(40)
    assert not set(learned) & set(tested)
    assert all(int(home.split(":")[2]) >= FIRST_TRAINING_SEED for home in learned)
    assert all(int(home.split(":")[2]) < FIRST_TRAINING_SEED for home in tested)
    assert "home:house:31" in tested


def test_walk_takes_small_steps_and_turns_on_free_floor(
    simulator: Simulator, rng: np.random.Generator
) -> None:
    poses = list(walk(simulator, CropSettings(), 40, rng))
    assert len(poses) >= 40
    for before, after in pairwise(poses):
        assert np.linalg.norm(np.subtract(before.position_xz, after.position_xz)) <= 0.25 + 1e-9
        assert abs(wrap_angle(after.heading_rad - before.heading_rad)) <= np.deg2rad(30.0) + 1e-9
    inside = [simulator.grid.clearance_at(pose.position_xz) > 0.05 for pose in poses]
    assert all(inside)


def test_truth_is_floor_where_the_body_fits_and_obstacle_at_walls(scene: Scene, simulator: Simulator) -> None:
    truth = TrueClasses(scene, simulator.grid.frame, 0.1)
    standing = simulator.grid.frame.centers_of(np.argwhere(simulator.grid.clearance_m > 0.2))
    cells = truth.frame.cells_of(standing)
    assert (truth.classes[cells[:, 0], cells[:, 1]] == FREE).mean() > 0.95  # doors have lintels
    shares = np.bincount(truth.classes.ravel(), minlength=3) / truth.classes.size
    assert shares[OCCUPIED] > 0.1
    assert shares[VOID] > 0.05


def test_truth_is_cut_out_around_the_agent(scene: Scene, simulator: Simulator) -> None:
    truth = TrueClasses(scene, simulator.grid.frame, 0.1)
    row, column = 20, 30
    x, z = truth.frame.centers_of((row, column))[0]
    square = truth.crop(ego_frame(21, 0.1, is_centred=True), FloorPose((x, z), 0.0))
    assert (square == truth.classes[row - 10 : row + 11, column - 10 : column + 11]).all()
    far = truth.crop(ego_frame(21, 0.1, is_centred=True), FloorPose((500.0, 0.0), 1.0))
    assert (far == VOID).all()


def test_what_was_seen_mostly_agrees_with_the_truth(crops: Crops) -> None:
    is_seen = crops.inputs.max(axis=1) > 0.5 * 255
    assert is_seen.mean() > 0.05
    assert (crops.inputs.argmax(axis=1) == crops.labels)[is_seen].mean() > 0.8


def test_probabilities_of_a_cell_add_up(crops: Crops) -> None:
    assert crops.inputs.sum(axis=1, dtype=np.int64) == pytest.approx(255, abs=2)
    assert class_shares(crops).sum() == pytest.approx(1.0)


def test_seed_repeats_the_crops(crops: Crops) -> None:
    again = gather(HOME, RASTER, TINY, seed=0)
    assert (again.inputs == crops.inputs).all()
    assert (again.labels == crops.labels).all()


def test_crops_that_were_kept_are_read_again(crops: Crops, tmp_path: Path) -> None:
    first = crops_of(HOME, RASTER, TINY, 0, tmp_path)
    assert (first.inputs == crops.inputs).all()
    kept = crops_of("home:studio:3", RASTER, CropSettings(crops_per_home=1), 99, tmp_path)
    assert (kept.labels == crops.labels).all()
    assert len(Crops.joined([first, kept])) == 12


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"min_steps": 200}, r"`min_steps` must be in \[1, max_steps\], got 200 of 120"),
        ({"crop_every": 0}, "`crop_every` must be >= 1, got 0"),
    ],
)
def test_senseless_settings_are_refused(options: dict[str, int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        CropSettings(**options)
