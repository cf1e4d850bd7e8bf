from dataclasses import replace

import pytest
import torch
from torch import Tensor

from anm_gym.map.fields import NetworkField
from anm_gym.map.hybrid_field import HybridField, make_field
from anm_gym.map.perturbation import perturbations, variability
from anm_gym.map.settings import FieldSettings, GridSettings, PerturbationFamily, VariabilitySettings

COARSE = GridSettings(voxel_m=0.4, band_m=100.0, noise_m=0.1, prior_std_m=0.3)
FINE = GridSettings(voxel_m=0.1, band_m=0.2, noise_m=0.03, prior_std_m=0.06)
SETTINGS = FieldSettings(width=16, grids=(COARSE, FINE))
RADIUS_M = 1.0


def sphere(points: Tensor) -> Tensor:
    return points.norm(dim=1) - RADIUS_M


def shell(count: int, generator: torch.Generator, inner_m: float = 0.8, outer_m: float = 2.0) -> Tensor:
    """Points around the sphere on the side of positive x alone."""
    directions = torch.nn.functional.normalize(torch.randn((count, 3), generator=generator), dim=1)
    directions[:, 0] = directions[:, 0].abs()
    return directions * (inner_m + (outer_m - inner_m) * torch.rand((count, 1), generator=generator))


@pytest.fixture
def field(generator: torch.Generator) -> HybridField:
    """A field that has seen one half of a sphere."""
    result = HybridField(SETTINGS, generator)
    for _ in range(60):
        for grid in result.grids():
            grid.begin_update()
        points = shell(8000, generator)
        result.observe(points, sphere(points))
    return result


def test_seen_sphere_is_known_to_a_centimetre(field: HybridField, generator: torch.Generator) -> None:
    points = shell(2000, generator, RADIUS_M, RADIUS_M)
    points = points[points[:, 0] > 0.3]
    assert field(points).abs().mean() < 0.01


def test_unseen_half_is_left_to_the_network(field: HybridField, generator: torch.Generator) -> None:
    points = shell(200, generator) - torch.tensor([3.0, 0.0, 0.0])
    assert torch.equal(field(points), field.network(points))


def test_what_was_seen_does_not_depend_on_the_network(field: HybridField, generator: torch.Generator) -> None:
    points = shell(500, generator, 0.95, 1.05)
    points = points[points[:, 0] > 0.3]
    before = field(points)
    with torch.no_grad():
        for parameter in field.network.parameters():
            parameter.add_(0.1)
    assert (field(points) - before).abs().max() < 0.01


def test_gradient_agrees_with_finite_differences(field: HybridField, generator: torch.Generator) -> None:
    points = shell(300, generator, 0.95, 1.05)
    points.requires_grad_()
    (gradient,) = torch.autograd.grad(field(points).sum(), points)
    step = 1e-3
    for axis in range(3):
        offset = step * torch.eye(3)[axis]
        with torch.no_grad():
            difference = (field(points + offset) - field(points - offset)) / (2.0 * step)
        assert (gradient[:, axis] - difference).abs().median() < 1e-2


@pytest.mark.parametrize("family", ["laplace", "delta_weight", "delta_norm", "unit_norm"])
def test_unseen_points_are_at_least_as_variable_as_seen_ones(
    family: PerturbationFamily, field: HybridField, generator: torch.Generator
) -> None:
    seen = shell(300, generator, RADIUS_M, RADIUS_M)
    unseen = seen - torch.tensor([4.0, 0.0, 0.0])
    settings = VariabilitySettings(family=family)
    size = sum(parameter.numel() for parameter in field.network.parameters())
    change = 0.01 * torch.randn(size, generator=generator)
    draws = perturbations(field, settings, change, seen, generator)
    scores = [variability(field, points, draws, settings, change) for points in (seen, unseen)]
    assert scores[1].median() > scores[0].median()


def test_isotropic_draws_share_their_norm_with_the_grids(
    field: HybridField, generator: torch.Generator
) -> None:
    size = sum(parameter.numel() for parameter in field.network.parameters())
    settings = VariabilitySettings(family="unit_norm")
    draws = perturbations(field, settings, torch.zeros(size), torch.zeros((1, 3)), generator)
    expected = (size / field.num_weights) ** 0.5
    assert torch.allclose(draws.norm(dim=1), torch.full((len(draws),), expected), rtol=1e-4)


@pytest.mark.parametrize("offset_m", [0.0, -4.0])
def test_mean_absolute_change_is_that_of_a_gaussian_with_and_without_grids(
    offset_m: float, field: HybridField, generator: torch.Generator
) -> None:
    points = shell(50, generator, 0.98, 1.02) + offset_m
    settings = VariabilitySettings(family="unit_norm", draws=2000)
    change = torch.zeros(sum(parameter.numel() for parameter in field.network.parameters()))
    draws = perturbations(field, settings, change, points, generator)
    variance = variability(field, points, draws, settings, change)
    absolute = variability(field, points, draws, replace(settings, statistic="mean_absolute"), change)
    assert torch.allclose(absolute, (2.0 / torch.pi * variance).sqrt(), rtol=0.1)


def test_settings_choose_the_field(generator: torch.Generator) -> None:
    assert isinstance(make_field(SETTINGS, generator), HybridField)
    plain = make_field(FieldSettings(width=16), generator)
    assert isinstance(plain, NetworkField)
    assert plain.name == "softplus-4x16"
    assert make_field(SETTINGS, generator).name == "softplus-4x16+40cm+10cm"
