"""The command line: what it trains, what it compares, how it refuses."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
import trimesh

from anm_gym.mesh import TriangleMesh
from train.navigator.__main__ import main
from train.navigator.table import KEY
from train.results import read_rows


def test_comparison_is_printed_and_written(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    arguments = ["--evaluate", "--navigators", "oracle", "--scenes", "home:studio:1", "--step-m", "0.25"]
    main([*arguments, "--episodes", "1", "--workers", "0", "--json", "table.json"])
    assert "home:studio:1" in capsys.readouterr().out
    (line,) = json.loads(Path("table.json").read_text())
    assert {
        "navigator",
        "scene",
        "step_m",
        "episodes",
        "success",
        "spl",
        "soft_spl",
        "collisions",
    } <= line.keys()
    assert (line["navigator"], line["step_m"], line["success"]) == ("oracle", 0.25, 1.0)


def test_mesh_is_read_with_options_and_only_with_those_of_its_rows(
    tmp_path: Path, box_room: Callable[..., TriangleMesh]
) -> None:
    room = box_room(6.0, 4.0)
    trimesh.Trimesh(room.vertices * 1000.0, room.faces, process=False).export(tmp_path / "room.glb")
    words = ["--evaluate", "--navigators", "oracle", "--episodes", "1", "--step-m", "0.25", "--workers", "0"]
    words += ["--scenes", str(tmp_path / "room.glb"), "--out", str(tmp_path / "run")]
    main([*words, "--scene-options", '{"unit": "mm"}'])
    (row,) = read_rows(tmp_path / "run" / "episodes.jsonl", KEY)
    assert row["scene_options"] == {"unit": "mm"}
    with pytest.raises(
        ValueError, match=r"the rows of room in .* must be read with `scene_options` \{\}, got"
    ):
        main(words)


def test_unknown_names_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="unknown variant 'moon'"):
        main(["--variant", "moon", "--out", str(tmp_path)])
    with pytest.raises(ValueError, match="`episodes` must be >= 1 for each of 1 scenes, got 0"):
        main(["--evaluate", "--navigators", "oracle", "--episodes", "0"])
