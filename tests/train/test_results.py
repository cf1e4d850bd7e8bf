"""Rows survive interruption: torn lines, earlier keys, errors."""

import json
import math

import numpy as np
import pytest

from train.results import append_row, finished_keys, read_rows, row_key


def make_row(**changes):
    row = {"agent": "random", "preset": "", "scene": "box", "seed": 0, "protocol": "explore-v0", "steps": 10}
    return row | {"settings_hash": "a1", "comp_pct": 50.0} | changes


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run" / "rows.jsonl"


def test_missing_file_has_no_rows(path):
    assert read_rows(path) == []


def test_rows_come_back_as_they_were_appended(path):
    rows = [make_row(seed=seed, cpu_ms={"learn": 1.5, "total": 2.0}) for seed in range(3)]
    for row in rows:
        append_row(path, row)
    assert read_rows(path) == rows


def test_torn_last_line_is_dropped(path):
    append_row(path, make_row(seed=0))
    with path.open("a") as file:
        file.write(json.dumps(make_row(seed=1))[:37])
    assert [row["seed"] for row in read_rows(path)] == [0]


def test_row_appended_after_a_torn_line_is_not_spoilt_by_it(path):
    append_row(path, make_row(seed=0))
    with path.open("a") as file:
        file.write('{"agent": "ran')
    append_row(path, make_row(seed=2))
    assert [row["seed"] for row in read_rows(path)] == [0, 2]


def test_line_torn_inside_a_character_is_dropped(path):
    append_row(path, make_row())
    with path.open("ab") as file:
        file.write('{"scene": "Küche'.encode()[:-4])
    assert len(read_rows(path)) == 1


def test_later_row_replaces_an_earlier_one_of_its_key(path):
    append_row(path, make_row(error="MapError: broken"))
    append_row(path, make_row(comp_pct=70.0))
    assert [row["comp_pct"] for row in read_rows(path)] == [70.0]


def test_failure_hides_no_row_that_is_there(path):
    append_row(path, make_row(comp_pct=70.0))
    append_row(path, make_row(error="MapError: broken"))
    assert [row["comp_pct"] for row in read_rows(path)] == [70.0]


def test_later_failure_replaces_an_earlier_one(path):
    append_row(path, make_row(error="MapError: old"))
    append_row(path, make_row(error="MapError: new"))
    assert [row["error"] for row in read_rows(path)] == ["MapError: new"]


def test_failed_episode_is_not_finished():
    good, bad = make_row(seed=0), make_row(seed=1, error="ValueError: no")
    assert finished_keys([good, bad]) == {row_key(good)}


@pytest.mark.parametrize("field", ["agent", "preset", "scene", "seed", "protocol", "steps"])
def test_each_condition_makes_another_key(field):
    assert row_key(make_row()) != row_key(make_row(**{field: "other"}))


def test_numpy_and_non_finite_values_become_plain(path):
    append_row(path, make_row(a=np.float32(0.5), b=np.int64(3), c=math.nan, d=[np.inf, (1, 2)]))
    (row,) = read_rows(path)
    assert (row["a"], row["b"], row["c"], row["d"]) == (0.5, 3, None, [None, [1, 2]])


def test_file_of_something_else_is_refused(path):
    path.parent.mkdir()
    path.write_text('{"loss": 1.0}\n')
    with pytest.raises(ValueError, match=r"line 1 of .* must have the fields of a result row, lacks"):
        read_rows(path)
