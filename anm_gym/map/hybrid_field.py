"""A network for what nobody has seen, refined by grids of distances where there is evidence (ours)."""

from functools import partial
from typing import final

import torch
from torch import Tensor, nn

from anm_gym.map.distance_grid import Corners, DistanceGrid
from anm_gym.map.fields import CornerVariance, Field, NetworkField, PointFunction
from anm_gym.map.settings import FieldSettings

NEGLIGIBLE_SHARE = 1e-3
"""Where less than this of the prediction is the network's, it is not asked."""


@final
class HybridField(Field):
    """A hierarchy of Gaussian beliefs about the distance.

    The network is the prior of the coarsest grid, each grid the prior of the next finer one. Where a grid
    has much evidence it speaks alone, so that what the network forgets is not lost; where it has
    none, the prediction is the network's extrapolation.

    Args:
        settings: Shape of the network, and the grids from coarse to fine.
        generator: Source of the initial weights.
    """

    def __init__(self, settings: FieldSettings, generator: torch.Generator) -> None:
        super().__init__()
        self.settings = settings
        self.prior = NetworkField(settings, generator)
        self.levels = nn.ModuleList(DistanceGrid(grid) for grid in settings.grids)
        spacings = "+".join(f"{100 * grid.voxel_m:.0f}cm" for grid in settings.grids)
        self.name = f"{self.prior.name}+{spacings}"

    @property
    def network(self) -> NetworkField:
        """The prior of the coarsest grid."""
        return self.prior

    def grids(self) -> list[DistanceGrid]:
        """The grids, coarse to fine."""
        return [grid for grid in self.levels if isinstance(grid, DistanceGrid)]

    def forward(self, points: Tensor) -> Tensor:
        """Predict the signed distance of (N, 3) points, (N,) float32 metres, positive in free space."""
        return self._predict(points, len(self.levels))

    def observe(self, points: Tensor, distances: Tensor) -> None:
        """Fit each grid to the observations within its band."""
        for level, grid in enumerate(self.grids()):
            near = torch.nonzero(distances.abs() <= grid.settings.band_m)[:, 0]
            weights = torch.where(distances < 0.0, grid.settings.behind_weight, 1.0)
            coarser = partial(self._predict, levels=level)
            grid.observe(points[near], distances[near], weights[near], coarser)

    def propagate(self, points: Tensor, of_network: PointFunction, of_corners: CornerVariance) -> Tensor:
        """Add the variance of each grid to what remains of its prior's."""
        located = [grid.corners(points) for grid in self.grids()]
        variance = self._of_network(points, located, of_network)
        for grid, corners in zip(self.grids(), located, strict=True):
            left = 1.0 - grid.known_share(corners)
            variance = left**2 * variance + of_corners(grid, corners)
        return variance

    def _predict(self, points: Tensor, levels: int) -> Tensor:
        """Predict from the network and the first `levels` grids."""
        grids = self.grids()[:levels]
        located = [grid.corners(points) for grid in grids]
        value = self._of_network(points, located, self.prior)
        for grid, corners in zip(grids, located, strict=True):
            value = grid.refine(corners, value)
        return value

    def _of_network(self, points: Tensor, located: list[Corners], ask: PointFunction) -> Tensor:
        """Ask the network at those points where its answer counts; 0 elsewhere."""
        share = torch.ones_like(points[:, 0])
        for grid, corners in zip(self.grids(), located, strict=False):
            share = share * (1.0 - grid.known_share(corners).detach())
        counts, answer = torch.nonzero(share > NEGLIGIBLE_SHARE)[:, 0], torch.zeros_like(share)
        return answer.index_copy(0, counts, ask(points[counts])) if len(counts) else answer


def make_field(settings: FieldSettings, generator: torch.Generator) -> Field:
    """Build the field that the settings describe: a network, or one with grids on top."""
    return HybridField(settings, generator) if settings.grids else NetworkField(settings, generator)
