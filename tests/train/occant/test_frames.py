from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from agents.layout_memory import EXPLORED, OCCUPIED
from agents.occant_model import OccAntSettings
from anm_gym.geometry import CameraSpec
from train.occant.frames import (
    Frames,
    FrameSettings,
    Labeller,
    frames_of,
    look_of,
    training_homes,
    unseen_homes,
)
from train.occant.twin_world import TwinWorld

MODEL = OccAntSettings()
SETTINGS = FrameSettings(frames_per_home=3, image_px=64)
NOTHING = np.zeros((2, 64, 64), bool)
AT_THE_DOOR = np.array([1.0, 1.55, -np.pi / 2])
"""In the left room, looking along +x through the door at x = 3 m."""


def label(world: TwinWorld, pose: np.ndarray = AT_THE_DOOR) -> np.ndarray:
    return Labeller(MODEL.layout, SETTINGS).label(world, pose, NOTHING)


def with_table(world: TwinWorld) -> TwinWorld:
    """Put a table of 0.7 m height across the left room, from x = 1.8 to 2.4 m."""
    top_m = world.top_m.copy()
    top_m[1:-1, 18:24] = 0.7
    return replace(world, top_m=top_m)


def test_label_reveals_the_room_up_to_its_walls(twin_rooms: TwinWorld) -> None:
    found = label(twin_rooms)
    # The wall beside the door is 2 m ahead and 1 m to the left.
    assert found[OCCUPIED, 63 - 20, 32 - 10]
    assert found[EXPLORED, 63 - 10, 32]
    assert not found[EXPLORED, 63 - 35 : 63 - 22, 32 - 10].any()


def test_label_reveals_what_is_beyond_the_door(twin_rooms: TwinWorld) -> None:
    assert label(twin_rooms)[EXPLORED, 63 - 30, 32]


def test_label_reveals_the_floor_behind_furniture(twin_rooms: TwinWorld) -> None:
    found = label(with_table(twin_rooms))
    assert found[OCCUPIED, 63 - 10, 32]
    assert found[EXPLORED, 63 - 18, 32]
    assert not found[OCCUPIED, 63 - 18, 32]


def test_look_shows_a_wall_where_it_is() -> None:
    camera = CameraSpec(64, 64)
    look = look_of(np.full((64, 64), 3.05, np.float32), camera, MODEL)
    rows = np.flatnonzero(look[OCCUPIED].any(axis=1))
    # The wall is in row 33; masks grow by a cell.
    assert rows.tolist() == [32, 33, 34]
    assert look[EXPLORED][33].sum() >= look[OCCUPIED][33].sum()


def test_frames_are_kept_and_read_again(tmp_path: Path) -> None:
    made = frames_of("home:studio:3", MODEL, SETTINGS, 0, tmp_path)
    read = frames_of("home:studio:3", MODEL, SETTINGS, 0, tmp_path)
    again = frames_of("home:studio:3", MODEL, SETTINGS, 0, None)
    for other in (read, again):
        assert (other.looks == made.looks).all()
        assert (other.labels == made.labels).all()
    # What is seen is revealed, but for the rim that masks have grown by.
    assert (made.labels[:, EXPLORED] & made.looks[:, EXPLORED]).sum() > 0.6 * made.looks[:, EXPLORED].sum()
    assert len(Frames.joined([made, read])) == 6


def test_homes_to_learn_from_and_to_test_on_differ() -> None:
    assert not set(training_homes(100)) & set(unseen_homes(100))


def test_at_least_one_frame_is_needed() -> None:
    with pytest.raises(ValueError, match="`frames_per_home` must be >= 1, got 0"):
        FrameSettings(frames_per_home=0)
