from dataclasses import replace

import numpy as np
import pytest
from tqdm import tqdm

from anm_gym.map import presets
from benchmarks.forgetting import draw, forget, format_table


@pytest.fixture
def rows(recording, monkeypatch):
    """Two variants of a small hybrid field over the recording, five times in a row."""
    best = presets.BEST
    small = replace(
        best,
        field=replace(best.field, width=16),
        schedule=replace(best.schedule, first_iterations=5),
        keyframes=replace(best.keyframes, max_interval=2),
    )
    monkeypatch.setitem(presets.PRESETS, "small", small)
    walk = replace(
        recording,
        depth_m=np.concatenate([recording.depth_m] * 5),
        world_from_camera=np.concatenate([recording.world_from_camera] * 5),
    )
    with tqdm(disable=True) as bar:
        return [row for name in ("small", "small+no_replay") for row in forget(walk, name, bar)]


def test_errors_are_taken_on_the_way_and_the_grids_keep_the_first_room(rows):
    assert [row["step"] for row in rows if row["preset"] == "small"] == list(range(2, 21))
    assert all(row["first_room_cm"] < row["first_room_network_cm"] for row in rows)
    assert rows[-1]["first_room_cm"] < 3.0


def test_table_and_picture_name_every_variant(rows, tmp_path):
    table = format_table(rows)
    assert "small+no_replay" in table
    assert f"{rows[-1]['first_room_network_cm']:.2f}" in table.splitlines()[-1]
    assert draw(rows, tmp_path / "forgetting.png").stat().st_size > 10_000
