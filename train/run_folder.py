"""A folder belongs to one run: its settings lie in it, and a run with others is refused."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

SETTINGS_FILE = "settings.json"


def claim_folder(folder: Path, settings: Mapping[str, Any], *, writes: bool = True) -> None:
    """Write the settings into a new folder, or check that they are those of the run that is there.

    The file appears whole or not at all, and is written once, so neither a kill nor another process
    finds half of it.

    Args:
        folder: The folder; it is made.
        settings: Plain values.
        writes: Whether this process is the one that writes.

    Raises:
        ValueError: If the folder holds a run with other settings.
    """
    path, text = folder / SETTINGS_FILE, json.dumps(settings, indent=2) + "\n"
    folder.mkdir(parents=True, exist_ok=True)
    if path.exists():
        if path.read_text(encoding="utf-8") != text:
            raise ValueError(f"`out` must be empty or hold a run with the same settings, got {str(folder)!r}")
    elif writes:
        partial = path.with_name(path.name + ".partial")
        partial.write_text(text, encoding="utf-8")
        partial.replace(path)
