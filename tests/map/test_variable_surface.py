import numpy as np
import pytest

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.presets import map_settings
from anm_gym.map.variable_surface import (
    SurfaceSettings,
    VariableSurface,
    weigh_by_variability,
    worthwhile_points,
)
from anm_gym.map.volume import UNKNOWN


def test_points_worth_a_look_lie_in_space_that_was_not_seen(left_room: NeuralMap) -> None:
    surface = worthwhile_points(left_room, SurfaceSettings())
    assert len(surface.points) > 20
    assert (left_room.volume.state_at(surface.points) == UNKNOWN).all()
    assert left_room.cloud.distance_of(surface.points).min() > 0.15


def test_what_is_predicted_behind_walls_that_were_seen_is_left_out(left_room: NeuralMap) -> None:
    def share_behind_walls(settings: SurfaceSettings) -> float:
        x, _, z = worthwhile_points(left_room, settings).points.T
        return float(((x < -4.2) | ((np.abs(z) > 2.2) & (x < -1.0))).mean())

    assert share_behind_walls(SurfaceSettings()) == 0.0
    assert share_behind_walls(SurfaceSettings(only_unseen=False)) > 0.01


def test_space_in_which_rays_met_nothing_has_no_rim() -> None:
    neural_map = NeuralMap(map_settings("fast"), CameraSpec(width_px=64, height_px=64))
    wall_to_the_right = np.zeros((64, 64), np.float32)
    wall_to_the_right[:, 32:] = 3.0
    neural_map.integrate(wall_to_the_right, camera_pose((0.0, 1.25, 0.0), heading_rad=0.0))
    found = worthwhile_points(neural_map, SurfaceSettings(frontier_share=0.5))
    rim = found.points[found.weights == 0.5]
    assert len(rim) > 10
    assert rim[:, 0].min() > -0.3
    # What is imagined is followed 1 m, but not from empty space.
    assert found.points[:, 0].min() > -1.3


@pytest.mark.parametrize("wrong", [{"block_voxels": 0}, {"margin_m": -0.1}, {"frontier_share": -1.0}])
def test_settings_that_mean_nothing_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=f"`{next(iter(wrong))}` must be >= "):
        SurfaceSettings(**wrong)  # type: ignore[arg-type]


def test_without_a_margin_nothing_beyond_free_space_is_predicted(left_room: NeuralMap) -> None:
    settings = SurfaceSettings(margin_m=0.0, frontier_share=0.0)
    assert len(worthwhile_points(left_room, settings).points) < 50


def test_all_surface_counts_when_variability_alone_is_trusted(left_room: NeuralMap) -> None:
    everything = worthwhile_points(left_room, SurfaceSettings(only_unseen=False))
    assert len(everything.points) > len(worthwhile_points(left_room, SurfaceSettings()).points)


def test_rim_of_free_space_is_in_the_door_and_can_be_left_out(left_room: NeuralMap) -> None:
    with_rim = worthwhile_points(left_room, SurfaceSettings(frontier_share=0.5))
    without = worthwhile_points(left_room, SurfaceSettings(frontier_share=0.0))
    rim = with_rim.points[with_rim.weights == 0.5]
    assert len(with_rim.points) == len(without.points) + len(rim) > len(without.points)
    assert left_room.cloud.distance_of(rim).min() > 0.3
    assert (rim[:, 0] > -0.5).any()


def test_well_known_surface_weighs_less_than_surface_never_seen(left_room: NeuralMap) -> None:
    seen = left_room.cloud.points[::40]
    beyond = seen + np.array([8.0, 0.0, 0.0], np.float32)
    points = VariableSurface(np.concatenate([seen, beyond]), np.ones(2 * len(seen), np.float32))
    weights = weigh_by_variability(left_room, points, SurfaceSettings()).weights
    assert ((weights >= 0.0) & (weights < 1.0)).all()
    assert np.median(weights[: len(seen)]) < 0.5 < 0.9 < np.median(weights[len(seen) :])
