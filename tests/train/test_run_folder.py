from pathlib import Path

import pytest

from train.run_folder import SETTINGS_FILE, claim_folder, read_settings


def test_folder_is_claimed_once_and_stays_as_it_is(tmp_path: Path) -> None:
    claim_folder(tmp_path / "run", {"seed": 1})
    path = tmp_path / "run" / SETTINGS_FILE
    before = path.stat().st_mtime_ns
    claim_folder(tmp_path / "run", {"seed": 1})
    assert path.stat().st_mtime_ns == before
    assert [file.name for file in path.parent.iterdir()] == [SETTINGS_FILE]


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
    assert [file.name for file in tmp_path.iterdir()] == [SETTINGS_FILE]


def test_setting_that_only_one_of_the_two_has_is_refused(tmp_path: Path) -> None:
    claim_folder(tmp_path, {"seed": 1, "kind": None})
    with pytest.raises(ValueError, match="got another `kind`"):
        claim_folder(tmp_path, {"seed": 1})


def test_process_that_does_not_write_leaves_the_folder_empty(tmp_path: Path) -> None:
    claim_folder(tmp_path, {"seed": 1}, writes=False)
    assert not list(tmp_path.iterdir())
