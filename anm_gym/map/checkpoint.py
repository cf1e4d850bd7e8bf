"""Saving and loading a neural map as safetensors: arrays and plain text, nothing that runs."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from anm_gym.errors import MapError
from anm_gym.geometry import CameraSpec
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.settings import (
    FieldSettings,
    GridSettings,
    KeyframeSettings,
    LossSettings,
    MapSettings,
    SamplingSettings,
    ScheduleSettings,
    VariabilitySettings,
)

FORMAT = "anm_gym.neural_map.3"
"""Version of the layout; a file of another one is refused."""
_STAGES = {
    "field": FieldSettings,
    "sampling": SamplingSettings,
    "loss": LossSettings,
    "schedule": ScheduleSettings,
    "keyframes": KeyframeSettings,
    "variability": VariabilitySettings,
}


def save_map(neural_map: NeuralMap, path: str | Path) -> None:
    """Write a map so that `load_map` restores it; the file appears whole or not at all.

    Args:
        neural_map: The map.
        path: A ``.safetensors`` file; an older one is replaced.
    """
    path = Path(path)
    metadata = {
        "format": FORMAT,
        "settings": json.dumps(asdict(neural_map.settings)),
        "camera": json.dumps(asdict(neural_map.camera)),
    }
    partial = path.with_name(path.name + ".partial")
    tensors = {name: tensor.contiguous().cpu() for name, tensor in neural_map.state().items()}
    save_file(tensors, partial, metadata=metadata)
    partial.replace(path)


def load_map(path: str | Path, *, device: str = "cpu") -> NeuralMap:
    """Read a map that `save_map` wrote.

    Args:
        path: The file.
        device: Where the network will live.

    Returns:
        A map that predicts the same, bit for bit on the CPU, and can go on learning.
        Its top-down occupancy is not stored; it starts anew with the next frame.

    Raises:
        MapError: If the file is missing, truncated, of another format or does not fit its settings.
    """
    try:
        with safe_open(str(path), framework="pt", device=device) as file:
            metadata = file.metadata() or {}
            tensors: dict[str, Tensor] = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (OSError, SafetensorError) as error:
        raise MapError(f"`path` must name a saved map, got {str(path)!r}: {error}") from error
    if metadata.get("format") != FORMAT:
        raise MapError(f"`path` must hold format {FORMAT!r}, got {metadata.get('format')!r} in {str(path)!r}")
    try:
        settings = _settings(json.loads(metadata["settings"]))
        neural_map = NeuralMap(settings, CameraSpec(**json.loads(metadata["camera"])), device=device)
        neural_map.load_state(tensors)
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise MapError(f"the map in {str(path)!r} must fit its settings, got {error}") from error
    return neural_map


def _settings(plain: dict[str, Any]) -> MapSettings:
    plain["field"]["grids"] = tuple(GridSettings(**grid) for grid in plain["field"]["grids"])
    stages = {name: stage(**plain.pop(name)) for name, stage in _STAGES.items()}
    return MapSettings(**plain, **stages)
