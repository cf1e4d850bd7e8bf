"""A folder belongs to one run: its settings lie in it, and a run with others is refused."""

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Final

from filelock import FileLock, Timeout

from anm_gym.whole_file import write_whole

SETTINGS_FILE: Final = "settings.json"
LOCK_FILE: Final = "run.lock"
"""Locked, by the operating system, while a run is under way; an unlocked one means nothing."""
_held: Final[dict[Path, FileLock]] = {}


def claim_folder(
    folder: Path, settings: Mapping[str, Any], *, may_change: Collection[str] = (), writes: bool = True
) -> None:
    """Write the settings into a new folder, or check that they are those of the run that is there.

    The file appears whole or not at all, so neither a kill nor another process finds half of it. It is
    written once, and again only if a setting that may change has changed. The process that writes holds the
    folder until it ends, whatever ends it.

    Args:
        folder: The folder; it is made.
        settings: Plain values.
        may_change: Names of settings that may be others when the run goes on.
        writes: Whether this process is the one that writes.

    Raises:
        ValueError: If the folder holds a run with other settings, or another process holds it.
    """
    path, text = folder / SETTINGS_FILE, json.dumps(settings, indent=2) + "\n"
    folder.mkdir(parents=True, exist_ok=True)
    asked = json.loads(text)
    is_same = _holds_same(folder, asked, may_change)
    if writes:
        hold_folder(folder)
        if not (is_same or _holds_same(folder, asked, may_change)):
            write_whole(path, text)


def _holds_same(folder: Path, asked: Mapping[str, Any], may_change: Collection[str]) -> bool:
    """Whether a folder holds exactly these settings; a ValueError if it holds others that may not change."""
    if not (folder / SETTINGS_FILE).exists():
        return False
    others = _differing(asked, read_settings(folder))
    if refused := [name for name in others if name not in may_change]:
        raise ValueError(
            "`out` must be empty or hold a run with the same settings, got another "
            f"`{refused[0]}` in {str(folder / SETTINGS_FILE)!r}; choose another folder"
        )
    return not others


def hold_folder(folder: Path) -> None:
    """Keep other processes from writing to a folder for as long as this one lives.

    Args:
        folder: The folder; it is made.

    Raises:
        ValueError: If another process holds it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder.resolve() / LOCK_FILE
    lock = _held.setdefault(path, FileLock(path, thread_local=False))
    if lock.is_locked:
        if path.exists():
            return
        lock.release()  # the folder was removed and made again
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise ValueError(
            f"`out` must be a folder that no other process writes to, got {str(folder)!r}, where a run is "
            "under way; wait for it or end it (workers may outlive a `torchrun` that was killed)"
        ) from None


def read_settings(folder: Path) -> dict[str, Any]:
    """Read the settings of the run in a folder, as JSON gives them.

    Raises:
        FileNotFoundError: If the folder holds no run.
        ValueError: If the file does not hold settings.
    """
    path = folder / SETTINGS_FILE
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (ValueError, TypeError) as error:
        raise ValueError(
            f"{path} must hold the settings of a run as a JSON object, got {error}; restore the file, or "
            "choose another folder"
        ) from error


def _differing(asked: Mapping[str, Any], found: Mapping[str, Any]) -> list[str]:
    """Names whose values differ, or that only one of the two has."""
    names = dict.fromkeys((*asked, *found))
    return [name for name in names if name not in asked or name not in found or asked[name] != found[name]]
