import numpy as np

from anm_gym.map.volume import FREE, OCCUPIED, UNKNOWN, ObservedVolume


def test_room_is_free_inside_occupied_on_its_walls_and_unknown_outside(tour) -> None:
    volume = ObservedVolume(tour.camera)
    for depth, pose in zip(tour.depths, tour.poses, strict=True):
        volume.integrate(depth, pose)
    inside = np.array([[0.0, 1.3, 0.0], [1.0, 1.0, 0.5], [-1.0, 1.5, -0.8]])
    walls = np.array([[2.0, 1.25, 0.0], [-2.0, 1.25, 0.2], [0.0, 1.25, 1.5], [-1.45, 0.0, 0.15]])
    across = np.array([[0.02, 0.0, 0.0], [0.02, 0.0, 0.0], [0.0, 0.0, 0.02], [0.0, 0.02, 0.0]])
    outside = np.array([[2.5, 1.2, 0.0], [0.0, 1.2, -2.0], [100.0, 0.0, 0.0]])
    assert (volume.state_at(inside) == FREE).all()
    either_side = volume.state_at(np.stack([walls - across, walls + across]))
    assert (either_side == OCCUPIED).any(axis=0).all()
    assert (volume.state_at(outside) == UNKNOWN).all()


def test_hits_are_never_erased(tour) -> None:
    volume = ObservedVolume(tour.camera)
    volume.integrate(tour.depths[0], tour.poses[0])
    occupied = np.argwhere(volume.states == OCCUPIED) + volume.low_index
    far = np.where(tour.depths[0] > 0, np.float32(7.9), 0).astype(np.float32)
    volume.integrate(far, tour.poses[0])
    centers = (occupied + 0.5) * volume.voxel_m
    assert (volume.state_at(centers) == OCCUPIED).all()


def test_empty_pixels_say_nothing(tour) -> None:
    volume = ObservedVolume(tour.camera)
    volume.integrate(np.zeros((64, 64), np.float32), tour.poses[0])
    assert (volume.states == UNKNOWN).all()


def test_depth_beyond_the_range_frees_but_does_not_hit(tour) -> None:
    volume = ObservedVolume(tour.camera, max_range_m=3.0)
    volume.integrate(np.full((64, 64), 9.0, np.float32), tour.poses[0])
    assert (volume.states == FREE).any()
    assert not (volume.states == OCCUPIED).any()
