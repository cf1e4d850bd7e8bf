"""The command that compares the presets."""

import json

import pytest

from benchmarks import mapping
from benchmarks.mapping import format_block, main
from benchmarks.quality import Effort


@pytest.fixture
def run(recording, tiny, tmp_path, monkeypatch):
    """Run the command on the box with the tiny settings under two names."""
    monkeypatch.setattr(mapping, "record", lambda *_: recording)
    monkeypatch.setattr(mapping, "map_settings", lambda name: tiny)
    monkeypatch.setattr(mapping, "QUICK", Effort(1000, 20, 100, 500))

    def with_options(*options):
        words = ["mapping", "--quick", "--out", str(tmp_path), *options]
        monkeypatch.setattr("sys.argv", words)
        main()

    return with_options


def test_command_leaves_rows_tables_and_a_picture(run, tmp_path, capsys):
    run("--presets", "tiny", "--families", "laplace,unit_norm", "--json", str(tmp_path / "rows.json"))
    rows = json.loads((tmp_path / "rows.json").read_text())
    assert [(row["trajectory"], row["preset"], row["family"], row["seed"]) for row in rows] == [
        ("box-0", "tiny", "laplace", 0),
        ("box-0", "tiny", "unit_norm", 0),
    ]
    assert [json.loads(line) for line in (tmp_path / "rows.jsonl").read_text().splitlines()] == rows
    assert (tmp_path / "mapping.png").read_bytes().startswith(b"\x89PNG")
    printed = capsys.readouterr().out
    assert "MAD seen (cm)" in printed
    assert "unseen/seen" in printed


def test_unknown_family_is_refused(run):
    with pytest.raises(ValueError, match="unknown families loss, dice; choose some of: unit_norm"):
        run("--families", "loss,dice")


def test_cost_is_compared_with_the_released_preset():
    numbers = dict.fromkeys([key for key, _, _ in (*mapping.MAP_COLUMNS, *mapping.FAMILY_COLUMNS)], 1.0)
    names = {"field": "net", "family": "laplace", "trajectory": "box-0", "steps": 4, "flops_step": 2e9}
    rows = [
        {**numbers, **names, "preset": "released", "cpu_ms_step": 500.0},
        {**numbers, **names, "preset": "fast", "cpu_ms_step": 4.0, "auroc_far": float("nan")},
    ]
    lines = format_block(rows).splitlines()
    assert "125.0" in next(line for line in lines if line.startswith("fast"))
    assert "–" not in lines[2]
    assert "–" in lines[-1]
    alone = format_block(rows[1:]).splitlines()
    assert "–" in alone[2]


def test_dropout_alone_is_refused_for_a_preset_that_drops_none(run):
    with pytest.raises(ValueError, match="`families` must name one beside 'dropout' for preset 'tiny'"):
        run("--presets", "tiny", "--families", "dropout")
