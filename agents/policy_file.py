"""Trained navigators as files."""

from pathlib import Path
from typing import Final

import torch

from agents.navigator_net import NavigatorNet, NavigatorNetSettings
from agents.weights_file import WEIGHTS_FOLDER, WeightsFormat
from agents.weights_identity import WeightsIdentity, weights_digest
from anm_gym.errors import PolicyError

FORMAT: Final = WeightsFormat("anm_gym.navigator.1", "policy")


def save_policy(net: NavigatorNet, path: str | Path) -> None:
    """Write a network so that `load_policy` restores it; the file appears whole or not at all.

    Args:
        net: The network.
        path: A ``.safetensors`` file; an older one is replaced.
    """
    FORMAT.write(path, net.state_dict(), net.settings.as_dict())


def load_policy(name_or_path: str | Path) -> NavigatorNet:
    """Read a network that `save_policy` wrote.

    Args:
        name_or_path: A file, or the name of one in `WEIGHTS_FOLDER`, such as ``"ddppo-plus"``.

    Raises:
        PolicyError: If the file is missing, truncated, of another format or does not fit its settings.
    """
    with FORMAT.reading(_path_of(name_or_path)) as (settings, tensors):
        with torch.random.fork_rng():
            net = NavigatorNet(NavigatorNetSettings.read(settings))
        net.load_state_dict(tensors)
    return net.eval()


def policy_identity(net: NavigatorNet) -> WeightsIdentity:
    """What tells a navigator's network at work from another of the same name."""
    return WeightsIdentity(net.settings.at_work(), weights_digest([net]))


def _path_of(name_or_path: str | Path) -> Path:
    path = Path(name_or_path)
    if path.suffix or path.is_file():
        return path
    shipped = WEIGHTS_FOLDER / f"{name_or_path}.safetensors"
    if not shipped.exists():
        known = ", ".join(sorted(file.stem for file in WEIGHTS_FOLDER.glob("ddppo-*.safetensors"))) or "none"
        raise PolicyError(f"unknown policy {str(name_or_path)!r}; choose one of: {known}, or give a file")
    return shipped
