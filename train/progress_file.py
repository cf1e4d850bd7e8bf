"""Networks, their optimiser and plain progress in one safetensors file, so that a killed run can go on."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn, optim

from anm_gym.errors import PolicyError
from anm_gym.whole_file import whole_file

_MOMENTS = ("exp_avg", "exp_avg_sq", "step")


def save_progress(
    path: Path, nets: Mapping[str, nn.Module], optimizer: optim.Optimizer, progress: Mapping[str, Any]
) -> None:
    """Write all that training needs to go on; the file appears whole or not at all.

    Args:
        path: A ``.safetensors`` file; an older one is replaced.
        nets: Networks by name; their parameters are the optimiser's.
        optimizer: Adam.
        progress: Plain values.
    """
    tensors: dict[str, Tensor] = {}
    for prefix, net in nets.items():
        tensors |= {f"{prefix}.{name}": value for name, value in net.state_dict().items()}
    for index, state in optimizer.state_dict()["state"].items():
        tensors |= {f"adam.{index}.{name}": state[name] for name in _MOMENTS}
    write_checkpoint(path, tensors, progress)


def load_progress(path: Path, nets: Mapping[str, nn.Module], optimizer: optim.Optimizer) -> dict[str, Any]:
    """Go back to what `save_progress` kept, and return the plain values.

    Args:
        path: The file.
        nets: Networks of the same names and shapes.
        optimizer: Adam over the same parameters.

    Raises:
        PolicyError: If the file cannot be read, or does not fit.
    """
    tensors, progress = read_checkpoint(path)
    state = optimizer.state_dict()
    count = len(state["param_groups"][0]["params"])
    known = [index for index in range(count) if f"adam.{index}.step" in tensors]
    state["state"] = {index: {name: tensors[f"adam.{index}.{name}"] for name in _MOMENTS} for index in known}
    try:
        for prefix, net in nets.items():
            net.load_state_dict(_below(f"{prefix}.", tensors))
        optimizer.load_state_dict(state)
    except (RuntimeError, ValueError) as error:
        raise PolicyError(
            f"the checkpoint {path} must fit the settings, got {error}; if an earlier version wrote it, "
            "delete it to start anew"
        ) from error
    return progress


def _below(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}


def write_checkpoint(path: Path, tensors: Mapping[str, Tensor], progress: Mapping[str, Any]) -> None:
    """Write tensors and plain values; the file appears whole or not at all."""
    # Copies: networks may share memory, and files do not.
    plain = {name: values.detach().cpu().clone().contiguous() for name, values in tensors.items()}
    with whole_file(path) as draft:
        save_file(plain, draft, metadata={"progress": json.dumps(dict(progress))})


def read_checkpoint(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read what `write_checkpoint` wrote.

    Raises:
        PolicyError: If the file cannot be read.
    """
    try:
        with safe_open(str(path), framework="pt") as file:
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            return tensors, json.loads((file.metadata() or {})["progress"])
    except (OSError, SafetensorError, KeyError) as error:
        raise PolicyError(
            f"the checkpoint {path} must be whole, got {error}; delete it to start anew"
        ) from error
