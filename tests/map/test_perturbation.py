from dataclasses import replace

import pytest
import torch

from anm_gym.map.fields import NetworkField
from anm_gym.map.perturbation import perturbations, variability
from anm_gym.map.settings import FieldSettings, PerturbationFamily, VariabilitySettings

SETTINGS = VariabilitySettings(draws=40)


@pytest.fixture
def field(generator: torch.Generator) -> NetworkField:
    return NetworkField(FieldSettings(width=16), generator)


@pytest.fixture
def change(field: NetworkField, generator: torch.Generator) -> torch.Tensor:
    size = sum(parameter.numel() for parameter in field.parameters())
    change = 0.01 * torch.randn(size, generator=generator)
    change[: size // 2] = 0.0
    return change


def draw(
    field: NetworkField, family: PerturbationFamily, change: torch.Tensor, generator: torch.Generator
) -> torch.Tensor:
    evidence = torch.rand(200, 3, generator=generator)
    return perturbations(field, replace(SETTINGS, family=family), change, evidence, generator)


def test_isotropic_draws_have_the_norm_of_their_family(
    field: NetworkField, change: torch.Tensor, generator: torch.Generator
) -> None:
    unit = draw(field, "unit_norm", change, generator)
    delta = draw(field, "delta_norm", change, generator)
    assert torch.allclose(unit.norm(dim=1), torch.ones(40), atol=1e-5)
    assert torch.allclose(delta.norm(dim=1), change.norm().expand(40), atol=1e-5)


def test_weights_that_did_not_change_are_not_perturbed(
    field: NetworkField, change: torch.Tensor, generator: torch.Generator
) -> None:
    draws = draw(field, "delta_weight", change, generator)
    assert (draws[:, change == 0.0] == 0.0).all()
    standardised = draws[:, change != 0.0] / change[change != 0.0]
    assert abs(float(standardised.std()) - 1.0) < 0.05


def test_laplace_variance_approaches_its_closed_form(field: NetworkField, generator: torch.Generator) -> None:
    settings = VariabilitySettings(family="laplace", draws=20_000)
    evidence, points = torch.rand(300, 3, generator=generator), 4.0 * torch.rand(12, 3, generator=generator)
    draws = perturbations(field, settings, torch.zeros(1), evidence, generator)
    with torch.no_grad():
        features = [torch.cat([field.features(x), torch.ones(len(x), 1)], dim=1) for x in (evidence, points)]
    precision = torch.eye(17) + features[0].T @ features[0]
    exact = 0.05**2 * torch.einsum("ni,ij,nj->n", features[1], precision.inverse(), features[1])
    assert torch.allclose(variability(field, points, draws, settings, torch.zeros(1)), exact, rtol=0.1)


def test_variability_is_the_spread_of_perturbed_predictions(
    field: NetworkField, change: torch.Tensor, generator: torch.Generator
) -> None:
    points = torch.rand(5, 3, generator=generator)
    draws = draw(field, "unit_norm", change, generator)[:3]
    weights = torch.nn.utils.parameters_to_vector(field.parameters()).detach()
    with torch.no_grad():
        reference, predictions = field(points), []
        for one in draws:
            torch.nn.utils.vector_to_parameters(weights + one, field.parameters())
            predictions.append(field(points))
        torch.nn.utils.vector_to_parameters(weights, field.parameters())
    stacked = torch.stack(predictions)
    settings = replace(SETTINGS, family="unit_norm")
    variance = variability(field, points, draws, settings, change)
    absolute = variability(field, points, draws, replace(settings, statistic="mean_absolute"), change)
    assert torch.allclose(variance, stacked.var(dim=0, correction=0), rtol=1e-3, atol=1e-8)
    assert torch.allclose(absolute, (stacked - reference).abs().mean(dim=0), rtol=1e-3, atol=1e-6)


def test_surface_far_from_the_evidence_is_more_variable(
    field: NetworkField, change: torch.Tensor, generator: torch.Generator
) -> None:
    settings = replace(SETTINGS, family="laplace", draws=200)
    evidence = torch.rand(500, 3, generator=generator)
    draws = perturbations(field, settings, change, evidence, generator)
    near = variability(field, torch.rand(100, 3, generator=generator), draws, settings, change)
    far = variability(field, 20.0 + torch.rand(100, 3, generator=generator), draws, settings, change)
    assert far.median() > 2.0 * near.median()


def test_no_points_have_no_variability(
    field: NetworkField, change: torch.Tensor, generator: torch.Generator
) -> None:
    draws = draw(field, "unit_norm", change, generator)
    assert variability(
        field, torch.zeros(0, 3), draws, replace(SETTINGS, family="unit_norm"), change
    ).shape == (0,)


def test_dropout_draws_repeat_and_need_a_field_with_dropout(
    field: NetworkField, change: torch.Tensor, generator: torch.Generator
) -> None:
    with pytest.raises(ValueError, match="must be > 0 for the family 'dropout', got 0"):
        draw(field, "dropout", change, generator)
    dropping = NetworkField(FieldSettings(width=16, dropout=0.2), generator)
    settings = replace(SETTINGS, family="dropout")
    draws = draw(dropping, "dropout", change, generator)
    points = torch.rand(6, 3, generator=generator)
    first, second = (variability(dropping, points, draws, settings, change) for _ in range(2))
    assert torch.equal(first, second)
    assert (first > 0.0).all()
