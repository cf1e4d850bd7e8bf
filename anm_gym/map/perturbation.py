"""Neural variability: how the predicted distance changes when the weights are perturbed.

Five families under one protocol. Each answers with (K, N) predictions of perturbed copies, of which
`variability` takes the variance (Eq. 4) or the mean absolute change (released code):

* ``unit_norm``: an isotropic direction over all weights, scaled to norm 1 (released code);
* ``delta_norm``: the same, scaled to the norm of the last weight change (Sec. 4.2, read globally);
* ``delta_weight``: each weight by its own last change (Sec. 4.2, read per weight);
* ``laplace``: the output layer by its posterior given the replayed surface (ours);
* ``dropout``: dropped units instead of moved weights (the paper's ablation, Table 2, Module 1). Its
  BALD score, the mutual information of a Gaussian, grows with this variance and ranks alike.
"""

import torch
from torch import Tensor
from torch.func import functional_call

from anm_gym.map.fields import SoftplusField
from anm_gym.map.settings import VariabilitySettings

CHUNK_POINTS = 8192


def perturbations(
    field: SoftplusField,
    settings: VariabilitySettings,
    weight_change: Tensor,
    evidence: Tensor,
    generator: torch.Generator,
) -> Tensor:
    """Draw weight perturbations of one family.

    Args:
        field: The network.
        settings: Family and number of draws.
        weight_change: (P,) change of all weights in the last map update.
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
    device = weight_change.device
    if settings.family == "laplace":
        return _laplace_perturbations(field, settings, evidence, generator)
    if settings.family == "dropout":
        if field.settings.dropout == 0.0:
            raise ValueError("`dropout` of the field must be > 0 for the family 'dropout', got 0")
        return torch.randint(1 << 24, (settings.draws, 1), generator=generator, device=device).float()
    noise = torch.randn((settings.draws, len(weight_change)), generator=generator, device=device)
    if settings.family == "delta_weight":
        return noise * weight_change.abs()
    unit: Tensor = noise / noise.norm(dim=1, keepdim=True)
    return unit if settings.family == "unit_norm" else unit * weight_change.norm()


def variability(field: SoftplusField, points: Tensor, draws: Tensor, settings: VariabilitySettings) -> Tensor:
    """Score points by the spread of their predictions under perturbed weights.

    Args:
        field: The network.
        points: (N, 3) float32, metres, world frame.
        draws: (K, P) from `perturbations`.
        settings: Family and statistic.

    Returns:
        (N,) float32: square metres for the variance, metres for the mean absolute change.

    Source:
        Active Neural Mapping, Eq. 4.
    """
    if len(points) == 0:
        return points[:, 0]
    return torch.cat([_spread(field, chunk, draws, settings) for chunk in points.split(CHUNK_POINTS)])


@torch.no_grad()
def _spread(field: SoftplusField, points: Tensor, draws: Tensor, settings: VariabilitySettings) -> Tensor:
    if settings.family == "laplace":
        change = _output_layer_changes(field, points, draws)
    elif settings.family == "dropout":
        change = _dropout_changes(field, points, draws)
    else:
        change = _all_layer_changes(field, points, draws)
    if settings.statistic == "variance":
        return change.var(dim=0, correction=0)
    return change.abs().mean(dim=0)


def _all_layer_changes(field: SoftplusField, points: Tensor, draws: Tensor) -> Tensor:
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


def _output_layer_changes(field: SoftplusField, points: Tensor, draws: Tensor) -> Tensor:
    """(K, N) change by perturbations of the output layer alone, for which the network is linear."""
    return field.settings.output_scale * (draws @ _features_with_bias(field, points).T)


def _dropout_changes(field: SoftplusField, points: Tensor, draws: Tensor) -> Tensor:
    """(K, N) prediction with dropped units minus that with all."""
    reference, changes = field(points), []
    for seed in draws[:, 0].tolist():
        generator = torch.Generator(points.device).manual_seed(int(seed))
        changes.append(field(points, dropout=generator) - reference)
    return torch.stack(changes)


def _features_with_bias(field: SoftplusField, points: Tensor) -> Tensor:
    features = field.features(points).float()
    return torch.cat([features, torch.ones_like(features[:, :1])], dim=1)


@torch.no_grad()
def _laplace_perturbations(
    field: SoftplusField, settings: VariabilitySettings, evidence: Tensor, generator: torch.Generator
) -> Tensor:
    """Draw the output layer from N(0, (prior + features^T features)^-1)."""
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
