"""The signed distance networks and their positional encodings.

A field only maps points to distances; how it is trained is the business of `anm_gym.map.neural_map`.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable

import torch
from torch import Tensor, nn
from torch.nn import functional

from anm_gym.map.distance_grid import Corners, DistanceGrid
from anm_gym.map.settings import FieldSettings

PointFunction = Callable[[Tensor], Tensor]
"""Maps (N, 3) points to (N,) values of a network there: distances, or the variance of its predictions."""

CornerVariance = Callable[[DistanceGrid, Corners], Tensor]
"""Maps corners around N points to the (N,) variance that a grid's own weights cause, square metres."""


def icosahedral_directions() -> Tensor:
    """Return the 21 unit directions of the encoding.

    One of each opposite pair of the 12 vertices and the 30 edge midpoints of an icosahedron.

    Returns:
        (21, 3) float32.

    Source:
        iSDF, as used by Active Neural Mapping, Sec. 5.1.
    """
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    vertices = torch.tensor(
        [
            vertex
            for a in (-1.0, 1.0)
            for b in (-golden, golden)
            for vertex in ((0.0, a, b), (a, b, 0.0), (b, 0.0, a))
        ],
        dtype=torch.float64,
    )
    first, second = torch.triu_indices(12, 12, offset=1)
    is_edge = (vertices[first] - vertices[second]).norm(dim=1) < 2.0 + 1e-6
    midpoints = (vertices[first] + vertices[second])[is_edge] / 2.0
    points = functional.normalize(torch.cat([vertices, midpoints]), dim=1)
    weights = torch.tensor([1.0, 1e-3, 1e-6], dtype=torch.float64)
    upper = points[points @ weights > 0]
    return upper.float()


class Encoding(nn.Module):
    """Sines and cosines of points projected on fixed directions at several octaves, and the point itself.

    The directions are those of iSDF, or the three axes.
    """

    directions: Tensor
    center_m: Tensor

    def __init__(self, settings: FieldSettings) -> None:
        super().__init__()
        frequencies = 2.0 ** torch.arange(settings.octaves, dtype=torch.float32)
        is_axial = settings.encoding == "axes"
        directions = math.pi * torch.eye(3) if is_axial else icosahedral_directions()
        bank = (frequencies[:, None, None] * directions).reshape(-1, 3)
        self.register_buffer("directions", bank.T.contiguous())
        self.register_buffer("center_m", torch.zeros(3))
        self.scale_per_m = settings.point_scale_per_m
        self.num_features = 2 * bank.shape[0] + 3

    def forward(self, points: Tensor) -> Tensor:
        """Encode (N, 3) metres as (N, num_features)."""
        scaled = (points - self.center_m) * self.scale_per_m
        with torch.autocast(points.device.type, enabled=False):  # a rounded phase would blur positions
            projected = scaled @ self.directions
        return torch.cat([scaled, projected.sin(), projected.cos()], dim=1)


class Field(nn.Module, ABC):
    """A signed distance over space: what every map has inside."""

    name: str
    """Short name in tables."""

    @property
    @abstractmethod
    def network(self) -> "NetworkField":
        """The part that gradient descent trains."""

    @abstractmethod
    def grids(self) -> list[DistanceGrid]:
        """The grids that refine the network, coarse to fine."""

    @property
    def num_weights(self) -> int:
        """Weights that a perturbation may move: those of the network and the corners of the grids."""
        of_network = sum(parameter.numel() for parameter in self.network.parameters())
        return of_network + sum(grid.num_weights for grid in self.grids())

    @abstractmethod
    def forward(self, points: Tensor) -> Tensor:
        """Predict the signed distance of (N, 3) points, (N,) float32 metres, positive in free space."""

    @abstractmethod
    def observe(self, points: Tensor, distances: Tensor) -> None:
        """Take in observed distances by other means than gradient descent, if there are any.

        Args:
            points: (N, 3) float32, metres, world frame.
            distances: (N,) float32 signed distances, metres.
        """

    @abstractmethod
    def propagate(self, points: Tensor, of_network: PointFunction, of_corners: CornerVariance) -> Tensor:
        """Carry the variance of the weights to predictions.

        Args:
            points: (N, 3) float32, metres, world frame.
            of_network: Variance of the network's predictions.
            of_corners: Variance by the corners of a grid; unused where there is none.

        Returns:
            (N,) float32 square metres.
        """


class NetworkField(Field):
    """The paper's multilayer perceptron, or its substitute with rectified units.

    Args:
        settings: Shape of the network; with softplus, 4 hidden layers have 328,449 parameters, 6 have
            460,033.
        generator: Source of the initial weights.

    Source:
        Active Neural Mapping, Sec. 5.1; Sec. 5.4 (Module 4) for the substitute.
    """

    def __init__(self, settings: FieldSettings, generator: torch.Generator) -> None:
        super().__init__()
        self.settings, self.name = (
            settings,
            f"{settings.activation}-{settings.hidden_layers}x{settings.width}",
        )
        self.encoding = Encoding(settings)
        encoded, width = self.encoding.num_features, settings.width
        inner = settings.hidden_layers // 2 - 1
        joined = width + encoded if settings.joins_encoding else width
        self.lower = nn.ModuleList([nn.Linear(n, width) for n in [encoded, *[width] * inner]])
        self.upper = nn.ModuleList([nn.Linear(n, width) for n in [joined, *[width] * inner]])
        self.output = nn.Linear(width, 1)
        self._initialise(generator)

    @property
    def network(self) -> "NetworkField":
        """The field itself."""
        return self

    def grids(self) -> list[DistanceGrid]:
        """None."""
        return []

    def _initialise(self, generator: torch.Generator) -> None:
        """Xavier-normal weights and uniform biases, drawn from one generator."""
        for layer in self.modules():
            if isinstance(layer, nn.Linear):
                nn.init.xavier_normal_(layer.weight, generator=generator)
                bound = layer.in_features**-0.5
                nn.init.uniform_(layer.bias, -bound, bound, generator=generator)

    def features(self, points: Tensor, dropout: torch.Generator | None = None) -> Tensor:
        """Return the last hidden layer, (N, width), which the output layer reads."""
        encoded: Tensor = self.encoding(points)
        hidden = encoded
        for layer in self.lower:
            hidden = self._activate(layer(hidden), dropout)
        if self.settings.joins_encoding:
            hidden = torch.cat([hidden, encoded.to(hidden.dtype)], dim=1)
        for layer in self.upper:
            hidden = self._activate(layer(hidden), dropout)
        return hidden

    def forward(
        self,
        points: Tensor,
        output_noise: Tensor | None = None,
        dropout: torch.Generator | None = None,
    ) -> Tensor:
        """Predict the signed distance of (N, 3) points, (N,) float32 metres, positive in free space.

        Args:
            points: (N, 3) float32, metres, world frame.
            output_noise: (N,) values added before the output is scaled, or None.
            dropout: Draws which units are dropped; None drops none.
        """
        raw: Tensor = self.output(self.features(points, dropout)).squeeze(1).float()
        if output_noise is not None:
            raw = raw + output_noise
        return raw * self.settings.output_scale

    def observe(self, points: Tensor, distances: Tensor) -> None:
        """Nothing: gradient descent is all that a network learns by."""

    def propagate(
        self,
        points: Tensor,
        of_network: PointFunction,
        of_corners: CornerVariance,  # noqa: ARG002 - there is no grid
    ) -> Tensor:
        """The network's own variance."""
        return of_network(points)

    def _activate(self, value: Tensor, dropout: torch.Generator | None) -> Tensor:
        share = self.settings.dropout
        if dropout is not None and share > 0.0:
            kept = torch.rand(value.shape, generator=dropout, device=value.device) >= share
            value = value * kept / (1.0 - share)
        if self.settings.activation == "relu":
            return torch.relu(value)
        activated: Tensor = functional.softplus(value, beta=self.settings.softplus_beta)
        return activated
