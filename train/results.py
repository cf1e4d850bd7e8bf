"""Result rows: one JSON line per episode, appended as it ends, read back after any interruption.

The tables made of the rows are in `train.tables.comparison`; this module knows the file only.
"""

import json
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from anm_gym.whole_file import write_whole

Row = dict[str, Any]
Key = tuple[Any, ...]

KEY_FIELDS: Final = ("agent", "preset", "scene", "seed", "protocol", "steps")
"""The fields that name an episode. The settings' hash is checked apart, by `train.tables.comparison`."""

ROW_FIELDS: Final = (
    *("agent", "scene", "seed", "protocol", "preset", "settings_hash", "steps"),
    *("comp_pct", "comp_cm", "comp_auc", "mad_cm", "fpr_pct", "path_m", "collisions", "cpu_ms"),
    *("comp_pct_official", "comp_cm_official", "mad_cm_official", "fpr_pct_official"),
    *("mad_seen_cm", "free_err_cm", "sign_err_pct", "auroc_seen", "auroc_false", "ause", "reliability"),
    *("geometry", "surface", "start", "attribution", "handovers", "curve", "measures"),
)
"""The fields that every row has; a measure that does not exist (a map's, without a map) is null."""

SCENE_FILE: Final = "scene_file"
"""Field that names the content of the scene's file; empty for a generated scene."""
MAP_LEFT_OUT: Final = "map_left_out"
"""Field that tells whether there was a map that nobody scored, so that its measures are still missing."""


def row_key(row: Mapping[str, Any], fields: Sequence[str] = KEY_FIELDS) -> Key:
    """Name the episode of a row: equal keys are the same episode under the same protocol."""
    return tuple(row[field] for field in fields)


def append_row(path: Path, row: Mapping[str, Any]) -> None:
    """Append one row and return only when it is on the disk.

    A torn line that an earlier process left at the end is closed first, so that it spoils itself alone.

    Args:
        path: The JSON lines file; it and its folder are made if needed.
        row: Plain values and containers; not-a-number and infinities become null.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    line = json.dumps(_plain(row), allow_nan=False, separators=(", ", ": ")) + "\n"
    with path.open("ab+") as file:
        if file.tell() > 0:
            file.seek(-1, os.SEEK_END)
            line = line if file.read(1) == b"\n" else "\n" + line
        file.write(line.encode())
        file.flush()
        os.fsync(file.fileno())


def write_json(path: Path, value: Any) -> Path:
    """Write plain values as indented JSON; not-a-number and infinities become null, paths their names."""
    text = json.dumps(_plain(value), indent=2, allow_nan=False, default=str)
    write_whole(path, text + "\n")
    return path


def read_rows(path: Path, fields: Sequence[str] = KEY_FIELDS) -> list[Row]:
    """Read the rows of a file, leaving out lines that a killed process tore.

    Args:
        path: The JSON lines file.
        fields: The fields that name an episode in this file.

    Returns:
        The rows in file order, later rows of a key replacing earlier ones, but for a failure, which replaces
        nothing that did not fail; empty if there is no file.

    Raises:
        ValueError: If a whole line lacks one of `fields`: the file is not one of such rows.
    """
    if not path.exists():
        return []
    rows: dict[Key, Row] = {}
    for number, line in enumerate(path.read_bytes().splitlines(), start=1):
        row = _parse(line)
        if row is None:
            continue
        missing = [field for field in fields if field not in row]
        if missing:
            raise ValueError(f"line {number} of {path} must have the fields of a result row, lacks {missing}")
        key = row_key(row, fields)
        if not row.get("error") or key not in rows or rows[key].get("error"):
            rows[key] = row
    return list(rows.values())


def finished_keys(rows: Iterable[Mapping[str, Any]]) -> set[Key]:
    """Collect the keys that need no rerun: every row but those of episodes that raised."""
    return {row_key(row) for row in rows if not row.get("error")}


def _parse(line: bytes) -> Row | None:
    try:
        row = json.loads(line)
    except ValueError:
        return None
    return row if isinstance(row, dict) else None


def _plain(value: Any) -> Any:
    """Turn numpy scalars into Python's and what JSON cannot say (NaN, infinity) into None."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
