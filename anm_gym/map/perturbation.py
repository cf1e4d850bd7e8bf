"""Neural variability: how the predicted distance changes when the weights are perturbed.

Five families under one protocol. Each perturbs the network K times; `variability` takes the variance
of the predictions (Eq. 4) or their mean absolute change (released code):

* ``unit_norm``: an isotropic direction over all weights, scaled to norm 1 (released code);
* ``delta_norm``: the same, scaled to the norm of the last weight change (Sec. 4.2, read globally);
* ``delta_weight``: each weight by its own last change (Sec. 4.2, read per weight);
* ``laplace``: the output layer by its posterior given the replayed surface (ours);
* ``dropout``: dropped units instead of moved weights (the paper's ablation, Table 2, Module 1). Its
  BALD score, the mutual information of a Gaussian, grows with this variance and ranks alike.

Predictions are linear in the corners of a grid, so their share of the variance needs no draws: it is
the weighted sum of each corner's variance under the same family.
"""

import math

import torch
from torch import Tensor
from torch.func import functional_call

from anm_gym.map.fields import CornerVariance, Field, NetworkField
from anm_gym.map.settings import VariabilitySettings

CHUNK_POINTS = 8192
GAUSSIAN_MEAN_ABSOLUTE = math.sqrt(2.0 / math.pi)
"""Mean absolute value of a Gaussian of unit variance; joins the means of a network and its grids."""


def perturbations(
    field: Field,
    settings: VariabilitySettings,
    weight_change: Tensor,
    evidence: Tensor,
    generator: torch.Generator,
) -> Tensor:
    """Draw perturbations of a field's network.

    Args:
        field: The field.
        settings: Family and number of draws.
        weight_change: (P,) change of the network's weights in the last map update.
        evidence: (E, 3) replayed surface points, metres; read by `laplace` alone.
        generator: Source of randomness.

    Returns:
        (K, P) float32, in the order of `torch.nn.utils.parameters_to_vector`; for `laplace` only
        the (K, width + 1) weights and bias of the output layer, for `dropout` (K, 1) seeds.

    Raises:
        ValueError: If the family is `dropout` and the field was built without.

    Source:
        Active Neural Mapping, Sec. 4.2, Eq. 4; its released code; `laplace` is ours.
    """
    network, device = field.network, weight_change.device
    if settings.family == "laplace":
        return _laplace_perturbations(network, settings, evidence, generator)
    if settings.family == "dropout":
        if network.settings.dropout == 0.0:
            raise ValueError("`dropout` of the field must be > 0 for the family 'dropout', got 0")
        return torch.randint(1 << 24, (settings.draws, 1), generator=generator, device=device).float()
    noise = torch.randn((settings.draws, len(weight_change)), generator=generator, device=device)
    if settings.family == "delta_weight":
        return noise * weight_change.abs()
    unit: Tensor = noise / noise.norm(dim=1, keepdim=True)
    return unit * math.sqrt(len(weight_change)) * _isotropic_std(field, settings, weight_change)


def variability(
    field: Field, points: Tensor, draws: Tensor, settings: VariabilitySettings, weight_change: Tensor
) -> Tensor:
    """Score points by the spread of their predictions under perturbed weights.

    Args:
        field: The field.
        points: (N, 3) float32, metres, world frame.
        draws: (K, P) from `perturbations`.
        settings: Family and statistic.
        weight_change: (P,) as for `perturbations`.

    Returns:
        (N,) float32: square metres for the variance, metres for the mean absolute change.

    Source:
        Active Neural Mapping, Eq. 4.
    """
    if len(points) == 0:
        return points[:, 0]
    of_corners = _corner_variance(field, settings, weight_change)
    is_variance = settings.statistic == "variance"

    def of_network(chunk: Tensor) -> Tensor:
        spread = _spread(field.network, chunk, draws, settings)
        return spread if is_variance else (spread / GAUSSIAN_MEAN_ABSOLUTE) ** 2

    with torch.no_grad():
        variance = torch.cat(
            [field.propagate(chunk, of_network, of_corners) for chunk in points.split(CHUNK_POINTS)]
        )
    return variance if is_variance else GAUSSIAN_MEAN_ABSOLUTE * variance.sqrt()


def _isotropic_std(field: Field, settings: VariabilitySettings, weight_change: Tensor) -> Tensor:
    """Standard deviation of each weight if the whole field is moved by a given norm."""
    squared = weight_change.square().sum()
    for grid in field.grids():
        squared = squared + grid.change.square().sum()
    norm = squared.sqrt() if settings.family == "delta_norm" else torch.ones_like(squared)
    return norm / math.sqrt(field.num_weights)


def _corner_variance(field: Field, settings: VariabilitySettings, weight_change: Tensor) -> CornerVariance:
    """What the corners of a grid contribute under a family."""
    if settings.family == "laplace":
        return lambda grid, corners: grid.variance(corners)
    if settings.family == "delta_weight":
        return lambda grid, corners: grid.perturbed_variance(corners, grid.change[corners.index])
    std = torch.zeros(1, device=weight_change.device)
    if settings.family != "dropout":
        std = _isotropic_std(field, settings, weight_change)
    return lambda grid, corners: grid.perturbed_variance(corners, std)


@torch.no_grad()
def _spread(field: NetworkField, points: Tensor, draws: Tensor, settings: VariabilitySettings) -> Tensor:
    if settings.family == "laplace":
        change = settings.noise_m * _output_layer_changes(field, points, draws)
    elif settings.family == "dropout":
        change = _dropout_changes(field, points, draws)
    else:
        change = _all_layer_changes(field, points, draws)
    if settings.statistic == "variance":
        return change.var(dim=0, correction=0)
    return change.abs().mean(dim=0)


def _all_layer_changes(field: NetworkField, points: Tensor, draws: Tensor) -> Tensor:
    """(K, N) prediction of each perturbed copy minus the unperturbed one."""
    names = [name for name, _ in field.named_parameters()]
    shapes = [parameter.shape for parameter in field.parameters()]
    sizes = [shape.numel() for shape in shapes]
    base = torch.nn.utils.parameters_to_vector(field.parameters()).detach()
    reference = field(points)
    changes = []
    for draw in draws:
        pieces = (base + draw).split(sizes)
        weights = {name: piece.view(shape) for name, piece, shape in zip(names, pieces, shapes, strict=True)}
        changes.append(functional_call(field, weights, (points,)) - reference)
    return torch.stack(changes)


def _output_layer_changes(field: NetworkField, points: Tensor, draws: Tensor) -> Tensor:
    """(K, N) change by perturbations of the output layer alone, for which the network is linear."""
    return draws @ _features_with_bias(field, points).T


def _dropout_changes(field: NetworkField, points: Tensor, draws: Tensor) -> Tensor:
    """(K, N) prediction with dropped units minus that with all."""
    reference, changes = field(points), []
    for seed in draws[:, 0].tolist():
        generator = torch.Generator(points.device).manual_seed(int(seed))
        changes.append(field(points, dropout=generator) - reference)
    return torch.stack(changes)


def _features_with_bias(field: NetworkField, points: Tensor) -> Tensor:
    features = field.features(points).float()
    return torch.cat([features, torch.ones_like(features[:, :1])], dim=1)


@torch.no_grad()
def _laplace_perturbations(
    field: NetworkField, settings: VariabilitySettings, evidence: Tensor, generator: torch.Generator
) -> Tensor:
    """Draw the output layer from N(0, (prior + features^T features)^-1), for observations of unit noise."""
    features = _features_with_bias(field, evidence).double()
    size = features.shape[1]
    eye = torch.eye(size, dtype=torch.float64, device=features.device)
    precision = settings.prior_precision * eye + features.T @ features
    factor = torch.linalg.cholesky(precision)
    noise = torch.randn(
        (size, settings.draws), generator=generator, device=features.device, dtype=torch.float64
    )
    draws: Tensor = torch.linalg.solve_triangular(factor.T, noise, upper=True)
    return draws.T.float()
