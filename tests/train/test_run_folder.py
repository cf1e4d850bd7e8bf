from pathlib import Path

import pytest

from train.run_folder import SETTINGS_FILE, claim_folder


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


def test_process_that_does_not_write_leaves_the_folder_empty(tmp_path: Path) -> None:
    claim_folder(tmp_path, {"seed": 1}, writes=False)
    assert not list(tmp_path.iterdir())
