from dataclasses import replace

import numpy as np
import pytest

from anm_gym.map.volume import EMPTY, FREE, OCCUPIED, UNKNOWN, ObservedVolume


@pytest.fixture
def room(tour) -> ObservedVolume:
    """The whole tour of the room, logged."""
    volume = ObservedVolume(tour.camera)
    for depth, pose in zip(tour.depths, tour.poses, strict=True):
        volume.integrate(depth, pose)
    return volume


def test_room_is_free_inside_occupied_on_its_walls_and_unknown_outside(room: ObservedVolume) -> None:
    inside = np.array([[0.0, 1.3, 0.0], [1.0, 1.0, 0.5], [-1.0, 1.5, -0.8]])
    walls = np.array([[2.0, 1.25, 0.0], [-2.0, 1.25, 0.2], [0.0, 1.25, 1.5], [-1.45, 0.0, 0.15]])
    across = np.array([[0.02, 0.0, 0.0], [0.02, 0.0, 0.0], [0.0, 0.0, 0.02], [0.0, 0.02, 0.0]])
    outside = np.array([[2.5, 1.2, 0.0], [0.0, 1.2, -2.0], [100.0, 0.0, 0.0]])
    assert (room.state_at(inside) == FREE).all()
    either_side = room.state_at(np.stack([walls - across, walls + across]))
    assert (either_side == OCCUPIED).any(axis=0).all()
    assert (room.state_at(outside) == UNKNOWN).all()


def test_hits_are_never_erased(tour) -> None:
    volume = ObservedVolume(tour.camera)
    volume.integrate(tour.depths[0], tour.poses[0])
    occupied = np.argwhere(volume.states == OCCUPIED) + volume.low_index
    far = np.where(tour.depths[0] > 0, np.float32(7.9), 0).astype(np.float32)
    volume.integrate(far, tour.poses[0])
    centers = (occupied + 0.5) * volume.voxel_m
    assert (volume.state_at(centers) == OCCUPIED).all()


def test_rays_that_meet_nothing_pass_empty_space_as_far_as_the_camera_sees(tour) -> None:
    volume = ObservedVolume(replace(tour.camera, max_depth_m=5.0))
    volume.integrate(np.zeros((64, 64), np.float32), tour.poses[0])
    ray = tour.poses[0][:3, :3] @ tour.camera.directions[31, 31]
    along = tour.poses[0][:3, 3] + np.array([[1.0], [4.5], [5.5], [-1.0]]) * ray
    assert volume.state_at(along).tolist() == [EMPTY, EMPTY, UNKNOWN, UNKNOWN]
    assert not (volume.states == OCCUPIED).any()


def test_empty_pixels_of_a_camera_that_is_blind_near_by_say_nothing(tour) -> None:
    volume = ObservedVolume(replace(tour.camera, min_depth_m=0.2))
    volume.integrate(np.zeros((64, 64), np.float32), tour.poses[0])
    assert (volume.states == UNKNOWN).all()


def test_depth_beyond_the_range_frees_but_does_not_hit(tour) -> None:
    volume = ObservedVolume(tour.camera, max_range_m=3.0)
    volume.integrate(np.full((64, 64), 9.0, np.float32), tour.poses[0])
    assert (volume.states == FREE).any()
    assert not (volume.states == OCCUPIED).any()


def test_space_before_a_surface_is_free_whether_rays_that_met_nothing_passed_before_or_after(tour) -> None:
    nothing, wall = np.zeros((64, 64), np.float32), np.full((64, 64), 3.0, np.float32)
    ahead = tour.poses[0][:3, 3] + 2.0 * tour.poses[0][:3, :3] @ tour.camera.directions[31, 31]
    for depths in ((nothing, wall), (wall, nothing)):
        volume = ObservedVolume(tour.camera)
        for depth in depths:
            volume.integrate(depth, tour.poses[0])
        assert volume.state_at(ahead) == FREE


def test_window_is_unknown_outside_the_log(room: ObservedVolume) -> None:
    low, high = room.low_index - 3, room.low_index + room.states.shape + 5
    window = room.window(low, high)
    assert np.array_equal(window[3:-5, 3:-5, 3:-5], room.states)
    assert (window > UNKNOWN).sum() == (room.states > UNKNOWN).sum()
    assert (room.window(high, high + 2) == UNKNOWN).all()


def test_rays_count_unknown_samples_and_end_at_obstacles(
    room: ObservedVolume, rng: np.random.Generator
) -> None:
    origins = rng.uniform([-1.8, 0.2, -1.3], [1.8, 2.3, 1.3], (500, 3)).T.astype(np.float32)
    steps = rng.normal(scale=0.06, size=(3, 500)).astype(np.float32)
    num_samples = np.sort(rng.integers(1, 40, 500))[::-1]
    unknown = room.trace(origins, steps, num_samples)
    for ray, count in enumerate(num_samples):
        samples = origins[:, ray] + np.arange(count)[:, None].astype(np.float32) * steps[:, ray]
        states = room.state_at(samples)
        assert unknown[ray] == (-1 if (states == OCCUPIED).any() else (states == UNKNOWN).sum())
    assert (unknown == 0).any()
    assert (unknown == -1).any()


def test_rays_far_from_the_log_meet_nothing(room: ObservedVolume) -> None:
    origins, steps = np.full((3, 2), 70.0, np.float32), np.full((3, 2), 0.1, np.float32)
    assert room.trace(origins, steps, np.array([30, 1])).tolist() == [30, 1]
    assert len(room.trace(origins[:, :0], steps[:, :0], np.zeros(0, int))) == 0
