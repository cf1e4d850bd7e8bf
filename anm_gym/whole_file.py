"""Files that appear whole or not at all, whatever ends the process or the machine."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Write a file in one stroke: a block writes it under another name, and then it is moved into place.

    An older file stays until the new one is complete and on the disk; if the block fails, nothing is left.

    Args:
        path: The file; its folder is made if needed. A link stays, and what it names is written.

    Yields:
        What to write to, in the same folder.

    Example:
        >>> with whole_file("/tmp/numbers.txt") as draft:
        ...     _ = draft.write_text("1 2 3")
    """
    path = Path(path).resolve()
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.partial")
    try:
        yield draft
        with draft.open("rb+") as file:
            os.fsync(file.fileno())
        draft.replace(path)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise


def write_whole(path: str | Path, text: str) -> None:
    """Write a text file in one stroke, see `whole_file`; a terminal or a pipe is simply written to.

    Args:
        path: The file; its folder is made if needed.
        text: Its content.
    """
    path = Path(path)
    if path.exists() and not path.is_file():
        path.write_text(text, encoding="utf-8")
        return
    with whole_file(path) as draft:
        draft.write_text(text, encoding="utf-8")
