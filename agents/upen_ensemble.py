"""UPEN's ensemble of occupancy predictors: networks, doubt, and files.

A member takes the class probabilities of a square around the agent, turned to its heading, and gives
those of the whole square, also of what was not seen.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal, get_args

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from agents.occupancy_net import occupancy_net
from agents.weights_identity import WeightsIdentity, weights_digest
from anm_gym.errors import PolicyError
from anm_gym.map.projection import NUM_CLASSES, OCCUPIED, PRESETS, ProjectionSettings

FORMAT: Final = "anm_gym.upen.1"
"""Version of the layout; a file of another one is refused."""
SHIPPED: Final = Path(__file__).parent / "weights" / "upen.safetensors"
"""The ensemble that comes with a checkout."""

Score = Literal["var_occ", "var_sum", "entropy", "mutual_info"]
SCORES: Final[tuple[Score, ...]] = get_args(Score)
"""Measures of doubt; `var_occ` is UPEN's."""


@dataclass(frozen=True)
class EnsembleSettings:
    """What the members are, and the raster that they were trained on."""

    net: str = "residual"
    """One of `agents.occupancy_net.OCCUPANCY_NETS`."""
    width: int = 12
    """Channels of the first stage; 64 in the paper's code."""
    members: int = 4
    """Networks (paper)."""
    cell_m: float = 0.1
    """Edge of a cell, metres; 0.05 in the paper's code."""
    crop_cells: int = 80
    """Cells along the square that is predicted: 8 m; 160 at half the edge in the paper's code."""
    projection: ProjectionSettings = PRESETS["upen"]
    """How depth becomes points."""

    def __post_init__(self) -> None:
        if self.members < 1:
            raise ValueError(f"`members` must be >= 1, got {self.members}")
        if self.cell_m <= 0.0 or self.crop_cells < 1:
            raise ValueError(
                f"`cell_m` and `crop_cells` must be > 0, got {self.cell_m} and {self.crop_cells}"
            )

    @classmethod
    def read(cls, plain: dict[str, Any]) -> "EnsembleSettings":
        """Build settings from the values of a file."""
        return cls(**{**plain, "projection": ProjectionSettings(**plain["projection"])})


class Ensemble:
    """Networks of one shape that were trained apart.

    Args:
        settings: What they are.
        nets: As many as the settings say.

    Raises:
        ValueError: If there are more or fewer.
    """

    def __init__(self, settings: EnsembleSettings, nets: Sequence[nn.Module]) -> None:
        if len(nets) != settings.members:
            raise ValueError(f"`nets` must hold {settings.members} networks, got {len(nets)}")
        self.settings = settings
        # Channels last is a quarter faster for these shapes.
        self.nets = [channels_last(net.eval()) for net in nets]

    @property
    def identity(self) -> WeightsIdentity:
        """What tells it from others."""
        return WeightsIdentity(self.settings, weights_digest(self.nets))

    def predict(self, crop: NDArray[np.float32]) -> NDArray[np.float32]:
        """Complete one square: (3, h, w) to (members, 3, h, w) float32 class probabilities."""
        return self.predict_batch(torch.from_numpy(crop)[None])[:, 0].numpy()

    @torch.inference_mode()
    def predict_batch(self, crops: Tensor) -> Tensor:
        """Complete squares: (N, 3, h, w) to (members, N, 3, h, w) class probabilities."""
        crops = crops.contiguous(memory_format=torch.channels_last)
        return torch.stack([net(crops).softmax(dim=1).contiguous() for net in self.nets])


def channels_last(net: nn.Module) -> nn.Module:
    """Lay the weights out as convolutions read them fastest, in place."""
    return net.to(memory_format=torch.channels_last)  # type: ignore[call-overload,no-any-return]


def new_net(settings: EnsembleSettings, seed: int) -> nn.Module:
    """Build an untrained member; the same seed gives the same weights."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return occupancy_net(settings.net, NUM_CLASSES, NUM_CLASSES, settings.width)


def doubt(probabilities: NDArray[np.float32], score: Score) -> NDArray[np.float32]:
    """Measure how much the members doubt, cell by cell.

    Args:
        probabilities: (members, 3, ...) float32 class probabilities.
        score: `var_occ`, variance of P(occupied) over members; `var_sum`, variances of all classes added;
            `entropy` of the members' mean, nats; `mutual_info`, that less the mean of their entropies, nats.

    Returns:
        (...) float32, higher where there is more doubt.

    Raises:
        ValueError: If there is no such score.

    Source:
        UPEN, Eq. 2 (`var_occ`); Houlsby et al., 2011 (`mutual_info`).
    """
    if score == "var_occ":
        return np.asarray(probabilities[:, OCCUPIED].var(axis=0))
    if score == "var_sum":
        return np.asarray(probabilities.var(axis=0).sum(axis=0))
    if score not in SCORES:
        raise ValueError(f"`score` must be one of {', '.join(SCORES)}, got {score!r}")
    total = _entropy(probabilities.mean(axis=0), axis=0)
    return total if score == "entropy" else total - _entropy(probabilities, axis=1).mean(axis=0)


def save_ensemble(ensemble: Ensemble, path: str | Path, *, is_half: bool = False) -> None:
    """Write an ensemble so that `load_ensemble` restores it; the file appears whole or not at all.

    Args:
        ensemble: The ensemble.
        path: A ``.safetensors`` file; an older one is replaced.
        is_half: Whether to keep 16 bits of each weight: half the size, and hardly a change.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    tensors = {}
    for index, net in enumerate(ensemble.nets):
        for name, values in net.state_dict().items():
            is_kept = not (is_half and values.is_floating_point())
            tensors[f"{index}.{name}"] = (values if is_kept else values.half()).contiguous().cpu()
    partial = path.with_name(path.name + ".partial")
    metadata = {"format": FORMAT, "settings": json.dumps(asdict(ensemble.settings))}
    save_file(tensors, partial, metadata=metadata)
    partial.replace(path)


def load_ensemble(path: str | Path = SHIPPED) -> Ensemble:
    """Read an ensemble that `save_ensemble` wrote.

    Args:
        path: The file; by default the one that comes with a checkout.

    Raises:
        PolicyError: If the file is missing, truncated, of another format or does not fit its settings.
    """
    try:
        with safe_open(str(path), framework="pt") as file:
            metadata: dict[str, Any] = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (OSError, SafetensorError) as error:
        raise PolicyError(
            f"`path` must name a saved ensemble, got {str(path)!r}: {error}; train one with "
            "`python -m train.upen`"
        ) from error
    if metadata.get("format") != FORMAT:
        raise PolicyError(
            f"an ensemble must have format {FORMAT!r}, got {metadata.get('format')!r} in {path}"
        )
    try:
        settings = EnsembleSettings.read(json.loads(metadata["settings"]))
        nets = [new_net(settings, seed) for seed in range(settings.members)]
        for index, net in enumerate(nets):
            net.load_state_dict(_member(tensors, index))
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise PolicyError(f"the ensemble in {path} must fit its settings, got {error}") from error
    return Ensemble(settings, nets)


def _member(tensors: dict[str, Tensor], index: int) -> dict[str, Tensor]:
    prefix = f"{index}."
    chosen = {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
    return {name: value.float() if value.is_floating_point() else value for name, value in chosen.items()}


def _entropy(probabilities: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    return np.asarray(-(probabilities * np.log(np.maximum(probabilities, 1e-12))).sum(axis=axis))
