import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from anm_gym.map.numerics import (
    flushed_subnormals,
    has_fast_bfloat16,
    usable_device,
    workers_flush_subnormals,
)


def is_flushing() -> bool:
    return not bool((torch.tensor([1e-40]) * 1.0).count_nonzero())


def test_subnormals_are_flushed_inside_the_block_alone() -> None:
    assert not is_flushing()
    with flushed_subnormals():
        assert is_flushing()
        with flushed_subnormals():
            pass
        assert is_flushing()
    assert not is_flushing()


def test_a_search_tree_over_equal_coordinates_can_be_built_after_the_pool_was_started() -> None:
    workers_flush_subnormals()
    points = np.zeros((5000, 3))
    points[:, 0] = np.linspace(0.0, 1.0, 5000)
    assert cKDTree(points).query([0.5, 0.0, 0.0])[0] < 1e-3


def test_bfloat16_is_only_claimed_where_the_processor_has_it() -> None:
    assert isinstance(has_fast_bfloat16(torch.device("cpu")), bool)


def test_device_that_torch_does_not_know_is_refused() -> None:
    with pytest.raises(ValueError, match=r"`device` must be one that torch knows, such as .* got 'gpu'"):
        usable_device("gpu")


def test_accelerator_beyond_the_last_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    assert usable_device("cuda:1").index == 1
    with pytest.raises(ValueError, match="this machine's 2 CUDA devices, got 'cuda:2'"):
        usable_device("cuda:2")


def test_missing_accelerator_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(ValueError, match="got 'cuda:0' without a CUDA device"):
        usable_device("cuda:0")
    assert usable_device("cpu").type == "cpu"
