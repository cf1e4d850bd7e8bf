from pathlib import Path

import torch
from torch import nn

from train.progress_file import load_progress, save_progress


def trained(steps: int) -> tuple[nn.Module, torch.optim.Optimizer]:
    with torch.random.fork_rng():
        torch.manual_seed(0)
        net = nn.Sequential(nn.Linear(3, 4), nn.BatchNorm1d(4), nn.Linear(4, 1))
    optimizer = torch.optim.Adam(net.parameters(), 1e-2)
    go_on(net, optimizer, range(steps))
    return net, optimizer


def go_on(net: nn.Module, optimizer: torch.optim.Optimizer, steps: range) -> None:
    for step in steps:
        generator = torch.Generator().manual_seed(step)
        optimizer.zero_grad()
        net(torch.rand(5, 3, generator=generator)).square().mean().backward()
        optimizer.step()


def test_training_goes_on_bit_for_bit(tmp_path: Path) -> None:
    net, optimizer = trained(4)
    save_progress(tmp_path / "a.safetensors", {"net": net}, optimizer, {"num_done": 4, "curve": [0.5]})
    go_on(net, optimizer, range(4, 8))
    again, fresh = trained(0)
    progress = load_progress(tmp_path / "a.safetensors", {"net": again}, fresh)
    assert progress == {"num_done": 4, "curve": [0.5]}
    go_on(again, fresh, range(progress["num_done"], 8))
    assert all(
        torch.equal(a, b) for a, b in zip(net.state_dict().values(), again.state_dict().values(), strict=True)
    )


def test_progress_before_the_first_step_can_be_kept(tmp_path: Path) -> None:
    net, optimizer = trained(0)
    save_progress(tmp_path / "a.safetensors", {"net": net}, optimizer, {})
    assert load_progress(tmp_path / "a.safetensors", {"net": net}, optimizer) == {}
    go_on(net, optimizer, range(1))
    assert not list(tmp_path.glob("*.partial"))
