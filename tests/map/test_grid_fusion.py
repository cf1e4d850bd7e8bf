import numpy as np
import pytest

from anm_gym.geometry import camera_pose
from anm_gym.map.grid_fusion import (
    BayesGrid,
    FloorPose,
    RunningAverageGrid,
    centred_frame,
    ego_frame,
    to_ego,
    to_registered,
    window_of,
)

CELL_M = 0.1
WHOLE = np.s_[0:4, 0:4]


def test_pose_on_the_floor_is_that_of_the_camera() -> None:
    pose = FloorPose.of(camera_pose((1.0, 1.25, -2.0), 0.6))
    assert pose.position_xz == pytest.approx((1.0, -2.0))
    assert pose.heading_rad == pytest.approx(0.6)


@pytest.mark.parametrize("heading_deg", [0.0, 90.0, 180.0, 37.0])
def test_what_lies_ahead_is_in_the_upper_half_of_the_square(heading_deg: float) -> None:
    pose = FloorPose((0.2, -0.3), float(np.deg2rad(heading_deg)))
    frame, ego = centred_frame((0.0, 0.0), 101, CELL_M), ego_frame(41, CELL_M, is_centred=True)
    ahead = np.array([-np.sin(pose.heading_rad), -np.cos(pose.heading_rad)])
    row, column = frame.cells_of(pose.position_xz + 1.5 * ahead)[0]
    values = np.zeros((1, *frame.shape), np.float32)
    values[0, row - 1 : row + 2, column - 1 : column + 2] = 1.0
    seen = to_ego(values, frame, ego, pose, 0.0)[0]
    assert np.unravel_index(seen.argmax(), seen.shape) == (
        pytest.approx(20 - 15, abs=1),
        pytest.approx(20, abs=1),
    )


def test_what_lies_to_the_right_is_on_the_right() -> None:
    frame, ego = centred_frame((0.0, 0.0), 81, CELL_M), ego_frame(41, CELL_M, is_centred=True)
    values = np.zeros((1, *frame.shape), np.float32)
    row, column = frame.cells_of((0.0, -1.0))[0]  # -z is to the right of an agent that looks along -x
    values[0, row, column] = 1.0
    looking_west = to_ego(values, frame, ego, FloorPose((0.0, 0.0), np.pi / 2), 0.0)[0]
    assert np.unravel_index(looking_west.argmax(), looking_west.shape) == (20, 30)


def test_square_comes_back_where_it_was_cut_out(rng: np.random.Generator) -> None:
    frame, ego = centred_frame((0.0, 0.0), 120, CELL_M), ego_frame(60, CELL_M, is_centred=True)
    x = np.linspace(0.0, 3.0, 120, dtype=np.float32)
    values = np.sin(x)[None, :, None] * np.cos(1.3 * x)[None, None, :] * np.ones((5, 1, 1), np.float32)
    for heading_rad in rng.uniform(-3.0, 3.0, 5):
        pose = FloorPose((0.33, -0.21), float(heading_rad))
        window, back = to_registered(to_ego(values, frame, ego, pose, 0.0), ego, frame, pose, np.nan)
        inside = np.isfinite(back)
        assert inside[0].sum() > 0.9 * 60 * 60
        assert back[inside] == pytest.approx(values[:, window[0], window[1]][inside], abs=0.02)


def test_aligned_square_is_copied_exactly(rng: np.random.Generator) -> None:
    frame, ego = centred_frame((0.0, 0.0), 40, CELL_M), ego_frame(10, CELL_M, is_centred=True)
    values = rng.random((2, 40, 40), dtype=np.float32)
    assert to_ego(values, frame, ego, FloorPose((0.0, 0.0), 0.0), 0.0) == pytest.approx(
        values[:, 15:25, 15:25]
    )


def test_agent_stands_under_the_forward_square() -> None:
    ego = ego_frame(64, CELL_M, is_centred=False)
    assert ego.cells_of((0.01, -0.01))[0].tolist() == [63, 32]


def test_window_stays_on_the_raster() -> None:
    frame, ego = centred_frame((0.0, 0.0), 50, CELL_M), ego_frame(30, CELL_M, is_centred=True)
    for position in ((2.4, 0.0), (-40.0, 40.0)):
        window, inner = window_of(frame, ego, FloorPose(position, 0.4))
        assert 0 <= window[0].start < window[0].stop <= 50
        assert inner.shape == (window[0].stop - window[0].start, window[1].stop - window[1].start)
        assert frame.centers_of((window[0].start, window[1].start))[0] == pytest.approx(
            inner.centers_of((0, 0))[0]
        )


def test_beyond_the_raster_is_the_fill() -> None:
    frame, ego = centred_frame((0.0, 0.0), 20, CELL_M), ego_frame(20, CELL_M, is_centred=True)
    far = to_ego(np.zeros((3, 20, 20), np.float32), frame, ego, FloorPose((30.0, 0.0), 0.0), 0.25)
    assert (far == 0.25).all()


def test_product_of_frames_is_normalised() -> None:
    grid = BayesGrid(centred_frame((0.0, 0.0), 4, 1.0), floor=0.0)
    frame = np.broadcast_to(np.array([0.2, 0.6, 0.2], np.float32)[:, None, None], (3, 4, 4))
    grid.fuse(WHOLE, frame)
    grid.fuse(WHOLE, frame)
    assert grid.probabilities[0, :, 0, 0] == pytest.approx(np.array([0.04, 0.36, 0.04]) / 0.44)


def test_uniform_frame_changes_nothing() -> None:
    grid = BayesGrid(centred_frame((0.0, 0.0), 4, 1.0), num_maps=2)
    grid.fuse(WHOLE, np.broadcast_to(np.array([0.7, 0.2, 0.1], np.float32)[:, None, None], (2, 3, 4, 4)))
    before = grid.probabilities.copy()
    grid.fuse(WHOLE, np.full((2, 3, 4, 4), 1.0 / 3.0, np.float32))
    assert grid.probabilities == pytest.approx(before)


@pytest.mark.parametrize(("floor", "recovers"), [(0.0, False), (1e-3, True)])
def test_floor_lets_a_cell_change_its_mind(floor: float, recovers: bool) -> None:
    grid = BayesGrid(centred_frame((0.0, 0.0), 4, 1.0), floor=floor)
    occupied = np.broadcast_to(np.array([0.05, 0.9, 0.05], np.float32)[:, None, None], (3, 4, 4))
    free = occupied[[0, 2, 1]]
    for _ in range(100):
        grid.fuse(WHOLE, occupied)
    for _ in range(10):
        grid.fuse(WHOLE, free)
    assert bool(grid.probabilities[0, :, 0, 0].argmax() == 2) is recovers
    assert np.isfinite(grid.probabilities).all()


def test_maps_of_one_grid_do_not_mix() -> None:
    grid = BayesGrid(centred_frame((0.0, 0.0), 4, 1.0), num_maps=2)
    frames = np.full((2, 3, 4, 4), 1.0 / 3.0, np.float32)
    frames[1] = np.array([0.1, 0.8, 0.1])[:, None, None]
    grid.fuse(WHOLE, frames)
    assert grid.probabilities[0] == pytest.approx(1.0 / 3.0)
    assert grid.probabilities[1, 1] == pytest.approx(0.8)


def test_known_cell_moves_a_tenth_and_a_new_one_all_the_way() -> None:
    grid = RunningAverageGrid(centred_frame((0.0, 0.0), 4, 1.0))
    grid.fuse(WHOLE, np.ones((2, 4, 4), np.float32))
    assert (grid.probabilities == 1.0).all()
    frame = np.stack([np.zeros((4, 4)), np.full((4, 4), 0.8)]).astype(np.float32)
    grid.fuse(WHOLE, frame)
    assert grid.probabilities[:, 0, 0] == pytest.approx([0.9, 0.98])


def test_unexplored_cells_of_a_frame_are_not_written() -> None:
    grid = RunningAverageGrid(centred_frame((0.0, 0.0), 4, 1.0))
    frame = np.full((2, 4, 4), 0.6, np.float32)
    frame[1, 0, 0] = 0.61
    grid.fuse(WHOLE, frame)
    assert grid.is_known.sum() == 1
    assert np.count_nonzero(grid.probabilities[0]) == 1


def test_senseless_weights_are_refused() -> None:
    frame = centred_frame((0.0, 0.0), 4, 1.0)
    with pytest.raises(ValueError, match=r"`floor` must be in \[0, 1 / num_classes\), got 0.5"):
        BayesGrid(frame, floor=0.5)
    with pytest.raises(ValueError, match=r"`keep_share` must be in \[0, 1\), got 1.0"):
        RunningAverageGrid(frame, keep_share=1.0)
