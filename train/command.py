"""What the commands share: lists on the command line, episode names, clear ends instead of tracebacks."""

import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from anm_gym.errors import AnmError
from train.pool import WorkerError


def split_list(text: str | Sequence[str]) -> list[str]:
    """Split a list that may be given with commas, with spaces, or as a YAML list.

    A single text is split at both; a list, as the shell or YAML gives it, at commas alone, so that paths may
    hold spaces.
    """
    if isinstance(text, str):
        return text.replace(",", " ").split()
    words = (word.strip() for part in text for word in part.split(","))
    return [word for word in words if word]


def parse_seeds(text: str | int | Sequence[str | int]) -> list[int]:
    """Read the seeds: one number N means 0 to N - 1, several numbers are the seeds themselves.

    Args:
        text: "3", "0,1,2", ["0", "1"]; a comma behind a single number makes it the seed: "7,", as does a
            list of numbers: [7].

    Raises:
        ValueError: If a word is not a whole number of at least 0, or no seed is named.
    """
    joined = str(text) if isinstance(text, str | int) else " ".join(map(str, text))
    if not isinstance(text, str | int) and any(isinstance(seed, int) for seed in text):
        joined += ","
    words = split_list(joined)
    are_numbers = bool(words) and all(word.isdecimal() for word in words)
    is_count = len(words) == 1 and "," not in joined
    if not are_numbers or (is_count and int(words[0]) == 0):
        raise ValueError(
            f"`seeds` must be a count of at least 1 or whole numbers such as '0,1,2', got {joined!r}; "
            "the seed 0 alone is '0,'"
        )
    return list(range(int(words[0]))) if is_count else [int(word) for word in words]


def scene_label(spec: str) -> str:
    """Name a scene in rows and tables: the file's stem, or the procedural name itself."""
    return Path(spec).stem if Path(spec).suffix else spec


def check_scene_names(scenes: Iterable[str]) -> None:
    """Refuse scenes that rows or files could not tell apart.

    Args:
        scenes: Paths or procedural names.

    Raises:
        ValueError: If two have one name in the rows, or names that differ in characters that `file_stem`
            does not keep.
    """
    labels = [scene_label(scene) for scene in scenes]
    if len({file_stem(label) for label in labels}) != len(labels):
        raise ValueError(
            f"`scenes` must have different names in rows and files, got {', '.join(labels)}; rename files "
            "that share one, or link them under other names in a folder of their own"
        )


def file_stem(*parts: str | int) -> str:
    """Name a file after what it holds, without characters that file systems refuse; empty parts fall away."""
    words = ["".join(c if c.isalnum() or c in "-." else "-" for c in str(part)) for part in parts]
    return "_".join(word for word in words if word)


def run_command(main: Callable[[], Any]) -> None:
    """Run a command's body; errors about the world or the arguments end as one line, exit code 2."""
    try:
        main()
    except (AnmError, ValueError, OSError, WorkerError) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("interrupted; repeated, the command goes on from its last row or checkpoint", file=sys.stderr)
        sys.exit(130)
