"""Text files that appear whole or not at all, whatever ends the process."""

import os
from pathlib import Path


def write_whole(path: Path, text: str) -> None:
    """Write a text file in one stroke; an older one stays until the new one is complete.

    Args:
        path: The file; its folder must exist.
        text: Its content.
    """
    path = path.resolve()
    if path.exists() and not path.is_file():  # a terminal or a pipe
        path.write_text(text, encoding="utf-8")
        return
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")
    try:
        with partial.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
