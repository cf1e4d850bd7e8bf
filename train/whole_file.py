"""Text files that appear whole or not at all, whatever ends the process."""

from pathlib import Path


def write_whole(path: Path, text: str) -> None:
    """Write a text file in one stroke; an older one stays until the new one is complete.

    Args:
        path: The file; its folder must exist.
        text: Its content.
    """
    partial = path.with_name(path.name + ".partial")
    partial.write_text(text, encoding="utf-8")
    partial.replace(path)
