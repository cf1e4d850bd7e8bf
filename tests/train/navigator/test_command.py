"""The command line: what it trains, what it compares, how it refuses."""

import json
from pathlib import Path

import pytest

from train.navigator.__main__ import main


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


def test_unknown_names_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="unknown variant 'moon'"):
        main(["--variant", "moon", "--out", str(tmp_path)])
    with pytest.raises(ValueError, match="`episodes` must be >= 1 for each of 1 scenes, got 0"):
        main(["--evaluate", "--navigators", "oracle", "--episodes", "0"])
