"""Trained navigators as files: safetensors, nothing that runs."""

import json
from pathlib import Path
from typing import Any, Final

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file

from agents.navigator_net import NavigatorNet, NavigatorNetSettings
from anm_gym.errors import PolicyError

FORMAT: Final = "anm_gym.navigator.1"
"""Version of the layout; a file of another one is refused."""
WEIGHTS_FOLDER: Final = Path(__file__).parent / "weights"
"""Where the trained policies that come with the package lie."""


def save_policy(net: NavigatorNet, path: str | Path) -> None:
    """Write a network so that `load_policy` restores it; the file appears whole or not at all.

    Args:
        net: The network.
        path: A ``.safetensors`` file; an older one is replaced.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".partial")
    metadata = {"format": FORMAT, "settings": json.dumps(net.settings.as_dict())}
    tensors = {name: values.detach().cpu().contiguous() for name, values in net.state_dict().items()}
    save_file(tensors, partial, metadata=metadata)
    partial.replace(path)


def load_policy(name_or_path: str | Path) -> NavigatorNet:
    """Read a network that `save_policy` wrote.

    Args:
        name_or_path: A file, or the name of one in `WEIGHTS_FOLDER`, such as ``"ddppo-plus"``.

    Raises:
        PolicyError: If the file is missing, truncated, of another format or does not fit its settings.
    """
    path = _path_of(name_or_path)
    try:
        with safe_open(str(path), framework="pt") as file:
            metadata: dict[str, Any] = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (OSError, SafetensorError) as error:
        raise PolicyError(f"`name_or_path` must name a saved policy, got {str(path)!r}: {error}") from error
    if metadata.get("format") != FORMAT:
        raise PolicyError(f"a policy must have format {FORMAT!r}, got {metadata.get('format')!r} in {path}")
    try:
        with torch.random.fork_rng():
            net = NavigatorNet(NavigatorNetSettings.read(json.loads(metadata["settings"])))
        net.load_state_dict(tensors)
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise PolicyError(f"the policy in {path} must fit its settings, got {error}") from error
    return net.eval()


def _path_of(name_or_path: str | Path) -> Path:
    path = Path(name_or_path)
    if path.suffix or path.is_file():
        return path
    shipped = WEIGHTS_FOLDER / f"{name_or_path}.safetensors"
    if not shipped.exists():
        known = ", ".join(sorted(file.stem for file in WEIGHTS_FOLDER.glob("*.safetensors"))) or "none"
        raise PolicyError(f"unknown policy {str(name_or_path)!r}; choose one of: {known}, or give a file")
    return shipped
