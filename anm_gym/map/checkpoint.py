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
from anm_gym.map.numerics import usable_device
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
from anm_gym.whole_file import whole_file

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


_RANKS = {".blocks": 2, ".table": 3, ".low_block": 1, ".values": 1, ".evidence": 1, ".change": 1}
"""Dimensions of a grid's tensors, by the end of their names; their sizes differ from map to map."""
_SHAPES: dict[str, tuple[int | None, ...]] = {
    "frames.poses": (None, 4, 4),
    "frames.losses": (None,),
    "cloud": (-1, 3),
    "volume.states": (-1, -1, -1),
    "volume.low_index": (3,),
    "counts": (3,),
}
"""Shapes of other tensors: None is the number of frames, -1 anything."""


def save_map(neural_map: NeuralMap, path: str | Path) -> None:
    """Write a map so that `load_map` restores it; the file appears whole or not at all.

    Args:
        neural_map: The map.
        path: A ``.safetensors`` file; an older one is replaced.
    """
    metadata = {
        "format": FORMAT,
        "settings": json.dumps(asdict(neural_map.settings)),
        "camera": json.dumps(asdict(neural_map.camera)),
    }
    tensors = {name: tensor.contiguous().cpu() for name, tensor in neural_map.state().items()}
    with whole_file(path) as draft:
        save_file(tensors, draft, metadata=metadata)


def load_map(path: str | Path, *, device: str = "cpu") -> NeuralMap:
    """Read a map that `save_map` wrote.

    Args:
        path: The file.
        device: Where the network will live.

    Returns:
        A map that predicts the same, bit for bit on the CPU, and can go on learning.
        Its top-down occupancy is not stored; it starts anew with the next frame.

    Raises:
        MapError: If the file is missing, truncated, of another format, does not fit its settings or holds
            what is no number.
        ValueError: If there is no such device here.
    """
    usable_device(device)
    try:
        with safe_open(str(path), framework="pt", device=device) as file:
            metadata = file.metadata() or {}
            tensors: dict[str, Tensor] = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (OSError, SafetensorError) as error:
        raise MapError(f"`path` must name a saved map, got {str(path)!r}: {error}") from error
    if metadata.get("format") != FORMAT:
        raise MapError(f"`path` must hold format {FORMAT!r}, got {metadata.get('format')!r} in {str(path)!r}")
    try:
        _check_tensors(tensors)
        settings = _settings(json.loads(metadata["settings"]))
        neural_map = NeuralMap(settings, CameraSpec(**json.loads(metadata["camera"])), device=device)
        neural_map.load_state(tensors)
    except (KeyError, TypeError, ValueError, RuntimeError, IndexError) as error:
        raise MapError(f"the map in {str(path)!r} must fit its settings, got {error}") from error
    return neural_map


def _check_tensors(tensors: dict[str, Tensor]) -> None:
    """Refuse tensors that would fail later only: numbers that are none, wrong ranks and shapes."""
    for name, tensor in tensors.items():
        if tensor.is_floating_point() and not bool(tensor.isfinite().all()):
            raise ValueError(f"{name} must hold finite numbers")
        rank = next((rank for ending, rank in _RANKS.items() if name.endswith(ending)), tensor.ndim)
        if tensor.ndim != rank:
            raise ValueError(f"{name} must have {rank} dimensions, got shape {tuple(tensor.shape)}")
    num_frames = len(tensors["frames.depths"])
    for name, shape in _SHAPES.items():
        expected = tuple(num_frames if side is None else side for side in shape)
        found = tuple(tensors[name].shape)
        if len(found) != len(shape) or any(e not in (-1, f) for e, f in zip(expected, found, strict=True)):
            raise ValueError(f"{name} must have shape {expected}, where -1 is any, got {found}")


def _settings(plain: dict[str, Any]) -> MapSettings:
    plain["field"]["grids"] = tuple(GridSettings(**grid) for grid in plain["field"]["grids"])
    stages = {name: stage(**plain.pop(name)) for name, stage in _STAGES.items()}
    return MapSettings(**plain, **stages)
