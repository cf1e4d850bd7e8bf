import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from train.run_folder import LOCK_FILE, SETTINGS_FILE, claim_folder, read_settings

ROOT = Path(__file__).resolve().parents[2]


def test_folder_is_claimed_once_and_stays_as_it_is(tmp_path: Path) -> None:
    claim_folder(tmp_path / "run", {"seed": 1})
    path = tmp_path / "run" / SETTINGS_FILE
    before = path.stat().st_mtime_ns
    claim_folder(tmp_path / "run", {"seed": 1})
    assert path.stat().st_mtime_ns == before
    assert {file.name for file in path.parent.iterdir()} == {SETTINGS_FILE, LOCK_FILE}


def test_other_settings_are_refused_and_kept(tmp_path: Path) -> None:
    claim_folder(tmp_path, {"seed": 1})
    with pytest.raises(ValueError, match="`out` must be empty or hold a run with the same settings"):
        claim_folder(tmp_path, {"seed": 2})
    claim_folder(tmp_path, {"seed": 1})


def test_settings_that_may_change_are_written_anew(tmp_path: Path) -> None:
    claim_folder(tmp_path, {"seed": 1, "steps": 5})
    claim_folder(tmp_path, {"seed": 1, "steps": 6}, may_change={"steps"})
    assert read_settings(tmp_path) == {"seed": 1, "steps": 6}
    with pytest.raises(ValueError, match=r"got another `seed` in .*; choose another folder"):
        claim_folder(tmp_path, {"seed": 2, "steps": 7}, may_change={"steps"})
    assert read_settings(tmp_path) == {"seed": 1, "steps": 6}
    assert {file.name for file in tmp_path.iterdir()} == {SETTINGS_FILE, LOCK_FILE}


def test_setting_that_only_one_of_the_two_has_is_refused(tmp_path: Path) -> None:
    claim_folder(tmp_path, {"seed": 1, "kind": None})
    with pytest.raises(ValueError, match="got another `kind`"):
        claim_folder(tmp_path, {"seed": 1})


def test_process_that_does_not_write_leaves_the_folder_empty(tmp_path: Path) -> None:
    claim_folder(tmp_path, {"seed": 1}, writes=False)
    assert not list(tmp_path.iterdir())


def test_folder_that_another_process_writes_to_is_refused_until_that_one_ends(tmp_path: Path) -> None:
    lines = (
        "from train.run_folder import *",
        f"claim_folder(Path({str(tmp_path)!r}), {{}})",
        "print(flush=True)",
    )
    with subprocess.Popen(
        [sys.executable, "-c", "; ".join([*lines, "input()"])],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as other:
        assert other.stdout is not None
        other.stdout.readline()
        with pytest.raises(ValueError, match="`out` must be a folder that no other process writes to"):
            claim_folder(tmp_path, {})
        claim_folder(tmp_path, {}, writes=False)
        with pytest.raises(ValueError, match="got another `seed`"):
            claim_folder(tmp_path, {"seed": 1})
        other.kill()
    claim_folder(tmp_path, {})


def test_refused_run_holds_nothing_and_a_folder_made_anew_is_held_anew(tmp_path: Path) -> None:
    claim_folder(tmp_path / "run", {"seed": 1}, writes=False)
    (tmp_path / "run" / SETTINGS_FILE).write_text('{"seed": 1}', encoding="utf-8")
    with pytest.raises(ValueError, match="got another `seed`"):
        claim_folder(tmp_path / "run", {"seed": 2})
    assert not (tmp_path / "run" / LOCK_FILE).exists()
    claim_folder(tmp_path / "run", {"seed": 1})
    shutil.rmtree(tmp_path / "run")
    claim_folder(tmp_path / "run", {"seed": 2})
    assert (tmp_path / "run" / LOCK_FILE).exists()


@pytest.mark.parametrize("text", ['{"net": {', "[1]", "3"])
def test_damaged_settings_are_named(tmp_path: Path, text: str) -> None:
    (tmp_path / SETTINGS_FILE).write_text(text, encoding="utf-8")
    for read in (read_settings, lambda folder: claim_folder(folder, {"seed": 1})):
        with pytest.raises(
            ValueError, match=r"settings\.json must hold the settings of a run as a JSON object"
        ):
            read(tmp_path)
