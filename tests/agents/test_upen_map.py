from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from agents.upen_ensemble import Ensemble, EnsembleSettings
from agents.upen_map import ObservedMap, PredictedMap, UpenMapSettings, free_and_unknown
from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.map.grid_fusion import FloorPose
from anm_gym.map.projection import FREE, OCCUPIED
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.backends import make_depth_camera

CAMERA = CameraSpec(width_px=64, height_px=64)
SMALL = EnsembleSettings(members=2, crop_cells=32)
MAP = UpenMapSettings(map_m=12.0)
START = FloorPose((0.0, 0.0), 0.0)


@pytest.fixture
def look(box_room: Callable[..., TriangleMesh]) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """Give `look(x, z, heading)`: depth and pose in a room of 4 x 4 m."""
    renderer = make_depth_camera(box_room(), CAMERA)

    def at(x_m: float, z_m: float, heading_rad: float) -> tuple[np.ndarray, np.ndarray]:
        pose = camera_pose((x_m, 1.25, z_m), heading_rad)
        return renderer.render(pose), pose

    return at


@pytest.fixture
def predicted_map(guessing: Callable[..., Ensemble]) -> Callable[..., PredictedMap]:
    """Give `predicted_map(**options)`: a map of two members that guess free and occupied."""

    def build(**options: Any) -> PredictedMap:
        ensemble = guessing(FREE, OCCUPIED)
        return PredictedMap(ensemble, CAMERA, START, UpenMapSettings(map_m=12.0, **options))

    return build


def test_turn_in_a_room_shows_floor_inside_walls(look) -> None:
    seen = ObservedMap(SMALL, CAMERA, START, MAP)
    for heading in np.deg2rad(np.arange(0.0, 360.0, 30.0)):
        seen.add(*look(0.0, 0.0, heading))
    labels = seen.grid.probabilities[0].argmax(axis=0)
    row, column = seen.grid.frame.cells_of((0.0, -1.55))[0]
    assert labels[row, column] == FREE
    row, column = seen.grid.frame.cells_of((0.0, -1.95))[0]
    assert OCCUPIED in labels[row - 1 : row + 1, column]
    beyond = seen.grid.probabilities[0][:, : row - 3]
    assert beyond == pytest.approx(1.0 / 3.0)


def test_crop_has_what_is_ahead_in_its_upper_half(look) -> None:
    seen = ObservedMap(SMALL, CAMERA, START, MAP)
    seen.add(*look(0.5, 0.2, 2.1))
    crop = seen.crop(FloorPose((0.5, 0.2), 2.1))
    is_seen = crop.max(axis=0) > 0.34
    assert is_seen[:15].sum() > 30
    assert is_seen[17:].sum() == 0


def test_mean_and_members_are_fused_each_for_itself(look, predicted_map) -> None:
    predicted = predicted_map()
    predicted.add(*look(0.0, 0.0, 0.0))
    behind = predicted.frame.cells_of((0.0, 1.0))[0]
    cell = (slice(None), slice(None), behind[0], behind[1])
    assert predicted.members[cell].argmax(axis=1).tolist() == [FREE, OCCUPIED]
    mean = predicted.mean[:, behind[0], behind[1]]
    assert mean[FREE] == pytest.approx(mean[OCCUPIED])


def test_doubt_shrinks_while_the_agent_stands_still(look, predicted_map) -> None:
    predicted = predicted_map()
    behind = tuple(predicted.frame.cells_of((0.0, 1.0))[0])
    sure = []
    for _ in range(3):
        predicted.add(*look(0.0, 0.0, 0.0))
        sure.append(predicted.members[0, FREE][behind])
    assert sure[0] < sure[1] < sure[2]


def test_cells_beyond_the_square_stay_uniform(look, predicted_map) -> None:
    predicted = predicted_map()
    predicted.add(*look(0.0, 0.0, 0.4))
    assert predicted.mean[:, 0] == pytest.approx(1.0 / 3.0)


def test_every_third_frame_is_predicted_from(look, predicted_map) -> None:
    predicted = predicted_map(predict_steps=3)
    maps = []
    for _ in range(4):
        predicted.add(*look(0.0, 0.0, 0.0))
        maps.append(predicted.mean.copy())
    assert (maps[0] == maps[2]).all()
    assert (maps[2] != maps[3]).any()


def test_labels_need_four_tenths() -> None:
    cells = np.array([[0.2, 0.2, 0.6], [0.2, 0.6, 0.2], [0.6, 0.2, 0.2], [0.31, 0.3, 0.39]], np.float32)
    free, unknown = free_and_unknown(cells.T[:, :, None])
    assert free.ravel().tolist() == [True, False, False, False]
    assert unknown.ravel().tolist() == [False, False, True, True]


def test_senseless_settings_are_refused() -> None:
    with pytest.raises(ValueError, match="`predict_steps` must be >= 1, got 0"):
        UpenMapSettings(predict_steps=0)
