"""Files that appear whole or not at all."""

import os

import pytest

from anm_gym.whole_file import write_whole


def test_older_file_stays_until_the_new_one_is_there(tmp_path, monkeypatch):
    path = tmp_path / "table.json"
    write_whole(path, "old")

    def fail(_descriptor):
        raise OSError("the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", fail)
        with pytest.raises(OSError, match="full"):
            write_whole(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
    write_whole(path, "new")
    assert path.read_text() == "new"


def test_two_processes_do_not_share_what_is_being_written(tmp_path, monkeypatch):
    """Another process that replaces its own half must not take ours away."""
    path, inner = tmp_path / "table.json", []

    def meanwhile(_descriptor):
        if not inner:
            inner.append(True)
            monkeypatch.setattr(os, "getpid", lambda: 1)
            write_whole(path, "theirs")

    monkeypatch.setattr(os, "fsync", meanwhile)
    write_whole(path, "ours")
    assert path.read_text() == "ours"


def test_link_stays_and_a_pipe_is_written_to(tmp_path):
    real, link = tmp_path / "real.json", tmp_path / "link.json"
    write_whole(real, "old")
    link.symlink_to(real)
    write_whole(link, "new")
    assert link.is_symlink()
    assert real.read_text() == "new"
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_whole(tmp_path / "pipe", "table")
    assert os.read(reader, 99) == b"table"
    os.close(reader)
