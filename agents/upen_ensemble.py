"""UPEN's ensemble of occupancy predictors: networks, doubt, and files.

A member takes the class probabilities of a square around the agent, turned to its heading, and gives
those of the whole square, also of what was not seen.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal, get_args

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.occupancy_net import OCCUPANCY_NETS, channels_last, occupancy_net
from agents.weights_file import WEIGHTS_FOLDER, WeightsFormat, prefixed, without_prefix
from agents.weights_identity import WeightsIdentity, weights_digest
from anm_gym.checks import check_at_least, check_positive
from anm_gym.map.projection import NUM_CLASSES, OCCUPIED, PRESETS, ProjectionSettings

FORMAT: Final = WeightsFormat(
    "anm_gym.upen.1", "ensemble", argument="path", hint="; train one with `python -m train.upen`"
)
SHIPPED: Final = WEIGHTS_FOLDER / "upen.safetensors"
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
        if self.net not in OCCUPANCY_NETS:
            raise ValueError(f"`net` must be one of {', '.join(sorted(OCCUPANCY_NETS))}, got {self.net!r}")
        check_at_least(self, 1, "width", "members", "crop_cells")
        check_positive(self, "cell_m")

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
    tensors: dict[str, Tensor] = {}
    for index, net in enumerate(ensemble.nets):
        tensors |= prefixed(str(index), net, is_half=is_half)
    FORMAT.write(path, tensors, asdict(ensemble.settings))


def load_ensemble(path: str | Path = SHIPPED) -> Ensemble:
    """Read an ensemble that `save_ensemble` wrote.

    Args:
        path: The file; by default the one that comes with a checkout.

    Raises:
        PolicyError: If the file is missing, truncated, of another format or does not fit its settings.
    """
    with FORMAT.reading(Path(path)) as (plain, tensors):
        settings = EnsembleSettings.read(plain)
        nets = [new_net(settings, seed) for seed in range(settings.members)]
        for index, net in enumerate(nets):
            net.load_state_dict(without_prefix(str(index), tensors))
    return Ensemble(settings, nets)


def _entropy(probabilities: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    return np.asarray(-(probabilities * np.log(np.maximum(probabilities, 1e-12))).sum(axis=axis))
