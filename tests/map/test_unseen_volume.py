import numpy as np
import pytest
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec
from anm_gym.map.unseen_volume import UnseenSettings, unseen_by_cell, unseen_volume
from anm_gym.map.volume import EMPTY, FREE, OCCUPIED, UNKNOWN, ObservedVolume

CAMERA = CameraSpec(width_px=64, height_px=64)
CENTER = np.array([[0.0, 1.25, 0.0]])
PLAIN = UnseenSettings(range_m=1.0, decay_m=float("inf"), leaves_out_shell=False)
LOW = np.array([-30, -2, -30])
"""Lowest voxel of the logs built here: 3 m around the origin, from 0.2 m under the floor."""
WHOLE_CONE_M3 = np.pi / 3.0
"""Volume of a square view of 90 degrees up to a horizontal range of 1 m: R³/3 * pi/2 * 2."""


def log_of(states: NDArray[np.uint8]) -> ObservedVolume:
    volume = ObservedVolume(CAMERA)
    volume.states, volume.low_index = states, LOW.copy()
    return volume


def filled(state: int) -> NDArray[np.uint8]:
    return np.full((60, 30, 60), state, np.uint8)


def gains(volume: ObservedVolume, settings: UnseenSettings = PLAIN) -> NDArray[np.float64]:
    return unseen_volume(volume, CENTER, 0.0, CAMERA, settings)[0]


def test_where_nothing_was_seen_the_whole_view_is_unseen() -> None:
    assert gains(ObservedVolume(CAMERA)) == pytest.approx(np.full(36, WHOLE_CONE_M3), rel=0.02)


def test_free_space_shows_nothing_new() -> None:
    assert gains(log_of(filled(FREE))).max() == 0.0


def test_view_gains_where_it_looks_into_the_unknown() -> None:
    states = filled(FREE)
    states[:, :, :30] = UNKNOWN  # z < 0, ahead of heading 0
    seen = gains(log_of(states))
    assert seen[0] == pytest.approx(WHOLE_CONE_M3, rel=0.02)
    assert seen[18] == 0.0
    assert seen[9] == pytest.approx(0.5 * WHOLE_CONE_M3, rel=0.15)


def test_space_in_which_rays_met_nothing_does_not_raise_the_top() -> None:
    states = filled(UNKNOWN)
    states[:, :17] = FREE  # to 1.5 m above the floor
    under_a_ceiling = gains(log_of(states))
    states[:, 17:, :20] = EMPTY
    assert gains(log_of(states)) == pytest.approx(under_a_ceiling)
    states[:, 17:, :20] = FREE
    assert gains(log_of(states)).max() > under_a_ceiling.max() + 0.1


def test_wall_hides_what_is_behind_it() -> None:
    states = filled(FREE)
    states[:, :, :20] = UNKNOWN  # from 1 m ahead
    far = UnseenSettings(range_m=2.0, decay_m=float("inf"), leaves_out_shell=False)
    assert gains(log_of(states), far)[0] > 1.0
    states[:, :, 20] = OCCUPIED
    assert gains(log_of(states), far)[0] == 0.0


def test_rays_end_at_the_floor() -> None:
    states = filled(UNKNOWN)
    low = np.array([[0.0, 0.45, 0.0]])
    cut = unseen_volume(log_of(states), low, 0.0, CAMERA, PLAIN)[0, 0]
    assert 0.6 * WHOLE_CONE_M3 < cut < 0.9 * WHOLE_CONE_M3


def test_hope_decays_in_unknown_space_alone() -> None:
    hopeful, cautious = PLAIN, UnseenSettings(range_m=1.0, decay_m=0.5, leaves_out_shell=False)
    unknown = ObservedVolume(CAMERA)
    assert 0.1 < gains(unknown, cautious)[0] / gains(unknown, hopeful)[0] < 0.6
    states = filled(FREE)
    states[:, :, :22] = UNKNOWN  # only the last 0.2 m of the range
    far = gains(log_of(states), cautious)[0] / gains(log_of(states), hopeful)[0]
    assert far > 0.8


def test_unknown_voxels_at_a_wall_can_be_left_out() -> None:
    states = filled(FREE)
    states[:, :, 22], states[:, :, 21] = UNKNOWN, OCCUPIED
    with_shell, without = PLAIN, UnseenSettings(range_m=1.0, decay_m=float("inf"))
    assert gains(log_of(states), with_shell)[0] > 0.01
    assert gains(log_of(states), without)[0] == 0.0


def test_cells_sum_up_to_the_views() -> None:
    volume = log_of(filled(UNKNOWN))
    places = np.array([[0.0, 1.25, 0.0], [0.7, 1.25, -0.4]])
    cells = unseen_by_cell(volume, places, 0.0, CAMERA, UnseenSettings(range_m=1.5))
    views = unseen_volume(volume, places, 0.0, CAMERA, UnseenSettings(range_m=1.5))
    assert cells.share @ cells.total_m3 == pytest.approx(views, rel=0.05)
    assert (cells.settled >= cells.share).all()
    assert cells.settled.max() <= 1.0


def test_no_place_shows_nothing() -> None:
    volume = log_of(filled(UNKNOWN))
    assert unseen_volume(volume, np.empty((0, 3)), 0.0, CAMERA, PLAIN).shape == (0, 36)
    assert unseen_by_cell(volume, np.empty((0, 3)), 0.0, CAMERA, PLAIN).share.shape == (0, 36, 0)


def test_settings_must_make_sense() -> None:
    with pytest.raises(ValueError, match=r"`range_m` must be > 0, got 0\.0"):
        UnseenSettings(range_m=0.0)
    with pytest.raises(ValueError, match="`num_elevations` must be >= 1"):
        UnseenSettings(num_elevations=0)


def test_ray_is_at_least_a_voxel_long() -> None:
    assert gains(log_of(filled(UNKNOWN)), UnseenSettings(range_m=0.05, leaves_out_shell=False)).min() > 0.0
