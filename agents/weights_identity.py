"""What tells trained networks from others of the same shape, so that their results are never mixed."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from torch import nn


@dataclass(frozen=True)
class WeightsIdentity:
    """Settings as they are in use, and a digest of the weights."""

    settings: Any
    """The settings, a frozen dataclass."""
    weights: str
    """See `weights_digest`."""


def weights_digest(nets: Iterable[nn.Module]) -> str:
    """Twelve hexadecimal digits that change with any weight of the networks."""
    total = hashlib.sha256()
    for net in nets:
        for value in net.state_dict().values():
            total.update(value.contiguous().cpu().numpy().tobytes())
    return total.hexdigest()[:12]
