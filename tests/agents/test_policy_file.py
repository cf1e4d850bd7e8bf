"""Saved policies come back as they were; others are refused by name."""

from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from agents.navigator_net import NavigatorNet, NavigatorNetSettings
from agents.policy_file import FORMAT, load_policy, save_policy
from anm_gym.errors import PolicyError


def test_policy_comes_back_bit_for_bit(tmp_path: Path) -> None:
    net = NavigatorNet(NavigatorNetSettings(lstm_size=16))
    save_policy(net, tmp_path / "one.safetensors")
    loaded = load_policy(tmp_path / "one.safetensors")
    assert loaded.settings == net.settings
    for name, values in net.state_dict().items():
        assert torch.equal(loaded.state_dict()[name], values)
    assert [path.name for path in tmp_path.iterdir()] == ["one.safetensors"]


def test_loading_draws_nothing(tmp_path: Path) -> None:
    save_policy(NavigatorNet(NavigatorNetSettings(lstm_size=16)), tmp_path / "one.safetensors")
    before = torch.random.get_rng_state()
    load_policy(tmp_path / "one.safetensors")
    assert torch.equal(torch.random.get_rng_state(), before)


def test_truncated_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "one.safetensors"
    save_policy(NavigatorNet(NavigatorNetSettings(lstm_size=16)), path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(PolicyError, match=r"`name_or_path` must name a saved policy, got .*one.safetensors"):
        load_policy(path)


def test_file_of_another_format_is_refused(tmp_path: Path) -> None:
    save_file({"x": torch.zeros(1)}, tmp_path / "map.safetensors", metadata={"format": "map"})
    with pytest.raises(PolicyError, match=f"must have format '{FORMAT.name}', got 'map'"):
        load_policy(tmp_path / "map.safetensors")


def test_policy_that_lacks_a_weight_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "one.safetensors"
    net = NavigatorNet(NavigatorNetSettings(lstm_size=16))
    del net.critic
    save_policy(net, path)
    with pytest.raises(PolicyError, match=r"(?s)must fit its settings, got .*critic"):
        load_policy(path)


def test_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(PolicyError, match="unknown policy 'resnet'; choose one of: "):
        load_policy("resnet")
