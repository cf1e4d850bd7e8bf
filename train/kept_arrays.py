"""Gathered data that is kept, so that a command that is started again need not gather it again."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from safetensors import SafetensorError
from safetensors.numpy import load_file, save_file

from anm_gym.errors import PolicyError
from anm_gym.whole_file import whole_file

ArraysT = TypeVar("ArraysT")


def kept(path: Path | None, kind: Callable[..., ArraysT], gather: Callable[[], ArraysT]) -> ArraysT:
    """Gather arrays, or read them from the file where they were kept.

    Args:
        path: A ``.safetensors`` file; it appears whole or not at all. None keeps nothing.
        kind: A dataclass of arrays.
        gather: Makes one.

    Raises:
        PolicyError: If the file cannot be read.
    """
    if path is None:
        return gather()
    if path.exists():
        try:
            return kind(**load_file(path))
        except (OSError, SafetensorError, TypeError) as error:
            raise PolicyError(
                f"the data in {path} must be whole, got {error}; delete it to gather it again"
            ) from error
    gathered = gather()
    with whole_file(path) as draft:
        save_file(vars(gathered), draft)
    return gathered
