from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from anm_gym.errors import PolicyError
from train.kept_arrays import kept


@dataclass(frozen=True, eq=False)
class Numbers:
    values: np.ndarray


def test_arrays_are_gathered_once(tmp_path: Path) -> None:
    calls = []

    def gather() -> Numbers:
        calls.append(1)
        return Numbers(np.arange(3))

    path = tmp_path / "folder" / "a.safetensors"
    first, second = kept(path, Numbers, gather), kept(path, Numbers, gather)
    assert np.array_equal(first.values, second.values)
    assert len(calls) == 1
    kept(None, Numbers, gather)
    assert len(calls) == 2


def test_damaged_file_is_a_named_error(tmp_path: Path) -> None:
    path = tmp_path / "a.safetensors"
    path.write_bytes(b"torn")
    with pytest.raises(PolicyError, match=r"a.safetensors must be whole, got .*delete it to gather it again"):
        kept(path, Numbers, lambda: Numbers(np.arange(3)))
