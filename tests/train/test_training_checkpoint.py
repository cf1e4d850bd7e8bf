"""A run leaves one file behind and goes on from it as if it had never stopped."""

from pathlib import Path

import pytest
import torch
from torch import nn

from anm_gym.errors import PolicyError
from train.training_checkpoint import Progress, TrainingCheckpoint


def make() -> tuple[nn.Module, torch.optim.Adam]:
    torch.manual_seed(3)
    module = nn.Linear(3, 2)
    return module, torch.optim.Adam(module.parameters(), lr=0.1)


def learn(module: nn.Module, optimizer: torch.optim.Adam, steps: int) -> None:
    for _ in range(steps):
        optimizer.zero_grad()
        module(torch.ones(1, 3)).square().sum().backward()
        optimizer.step()


def test_learning_goes_on_bit_for_bit(tmp_path: Path) -> None:
    module, optimizer = make()
    checkpoint = TrainingCheckpoint(tmp_path / "one.safetensors")
    learn(module, optimizer, 3)
    checkpoint.save(module, optimizer, Progress("imitation", 30, curve=[{"frames": 10}]))
    learn(module, optimizer, 3)
    other, its_optimizer = make()
    checkpoint.restore(other, its_optimizer)
    learn(other, its_optimizer, 3)
    assert torch.equal(module.weight, other.weight)
    progress = checkpoint.progress()
    assert progress == Progress("imitation", 30, curve=[{"frames": 10}])


def test_no_file_is_no_progress(tmp_path: Path) -> None:
    assert TrainingCheckpoint(tmp_path / "none.safetensors").progress() is None


def test_truncated_file_is_refused_and_kept(tmp_path: Path) -> None:
    checkpoint = TrainingCheckpoint(tmp_path / "one.safetensors")
    checkpoint.save(*make(), Progress("imitation"))
    data = checkpoint.path.read_bytes()[:-8]
    checkpoint.path.write_bytes(data)
    with pytest.raises(PolicyError, match=r"one.safetensors must be whole, got .*delete it to start anew"):
        checkpoint.progress()
    assert checkpoint.path.read_bytes() == data


def test_other_weights_are_refused(tmp_path: Path) -> None:
    checkpoint = TrainingCheckpoint(tmp_path / "one.safetensors")
    checkpoint.save(*make(), Progress("imitation"))
    other = nn.Linear(4, 2)
    with pytest.raises(PolicyError, match=r"(?s)must fit the settings, got .*size mismatch"):
        checkpoint.restore(other, torch.optim.Adam(other.parameters()))
