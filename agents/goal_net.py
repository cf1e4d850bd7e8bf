"""OccAnt's global policy as a plain network: maps in, one score for each goal out.

It is trained by Stable-Baselines3 in `train.occant`; only its actor is needed to explore.
"""

from dataclasses import dataclass
from typing import final

import torch
from torch import nn

from agents.layout_memory import VIEW_CHANNELS


@dataclass(frozen=True)
class GoalNetSettings:
    """Layers of the network."""

    widths: tuple[int, ...] = (16, 16, 16, 8)
    """Channels of the hidden layers (8, 4, 4, 2 in the paper's code)."""
    kernels: tuple[int, ...] = (3, 3, 5, 5, 5)
    """Edges of the kernels, the last layer's too (paper's code)."""

    def __post_init__(self) -> None:
        if len(self.kernels) != len(self.widths) + 1:
            raise ValueError(
                "`kernels` must have one more entry than `widths`, "
                f"got {len(self.kernels)} and {len(self.widths)}"
            )


@final
class GoalNet(nn.Module):
    """Score every cell of the far view as a goal.

    Convolutions only, so that a place is judged by what lies around it. The paper's code normalises
    batches, which upsets the ratios of PPO; this does not.

    Args:
        settings: Layers.

    Source:
        Occupancy Anticipation, Ramakrishnan et al., 2020, global policy.
    """

    def __init__(self, settings: GoalNetSettings | None = None) -> None:
        super().__init__()
        self.settings = settings or GoalNetSettings()
        widths = (VIEW_CHANNELS, *self.settings.widths, 1)
        layers: list[nn.Module] = []
        for before, after, kernel in zip(widths[:-1], widths[1:], self.settings.kernels, strict=True):
            layers += [nn.Conv2d(before, after, kernel, padding=kernel // 2), nn.ReLU()]
        self.layers = nn.Sequential(*layers[:-1])

    def forward(self, maps: torch.Tensor) -> torch.Tensor:
        """Score goals.

        Args:
            maps: (N, 9, G, G) float32 in [0, 1], see `LayoutMemory.view`.

        Returns:
            (N, G * G) float32 logits in row order.
        """
        scores: torch.Tensor = self.layers(maps.contiguous(memory_format=torch.channels_last))
        return scores.flatten(start_dim=1)
