import pytest
import torch

from anm_gym.map.fields import Encoding, NetworkField, icosahedral_directions
from anm_gym.map.settings import FieldSettings


def test_there_are_21_directions_no_two_of_them_parallel() -> None:
    directions = icosahedral_directions().double()
    assert directions.shape == (21, 3)
    assert torch.allclose(directions.norm(dim=1), torch.ones(21, dtype=torch.float64))
    cosines = (directions @ directions.T).abs() - torch.eye(21, dtype=torch.float64)
    assert cosines.max() < 0.9


def test_encoding_has_255_features_with_the_longest_wave_of_106_metres() -> None:
    encoding = Encoding(FieldSettings())
    assert encoding.num_features == 255
    direction = icosahedral_directions()[0]
    wavelength_m = 2.0 * torch.pi / 0.05937489
    here, there = encoding(torch.zeros(1, 3)), encoding((wavelength_m * direction)[None])
    assert abs(wavelength_m - 105.8) < 0.1
    assert torch.allclose(here[:, 3], there[:, 3], atol=1e-4)


@pytest.mark.parametrize(("hidden_layers", "parameters"), [(4, 328_449), (6, 460_033)])
def test_paper_and_released_networks_have_their_sizes(
    hidden_layers: int, parameters: int, generator: torch.Generator
) -> None:
    field = NetworkField(FieldSettings(hidden_layers=hidden_layers), generator)
    assert sum(parameter.numel() for parameter in field.parameters()) == parameters


def test_same_seed_gives_the_same_weights() -> None:
    first, second = (NetworkField(FieldSettings(), torch.Generator().manual_seed(5)) for _ in range(2))
    points = torch.rand(10, 3)
    assert torch.equal(first(points), second(points))


def test_gradient_agrees_with_finite_differences(generator: torch.Generator) -> None:
    field = NetworkField(FieldSettings(width=32), generator).double()
    field.encoding.double()
    points = torch.rand(20, 3, dtype=torch.float64, requires_grad=True)
    raw = field.output(field.features(points)).squeeze(1)
    (gradient,) = torch.autograd.grad(raw.sum(), points)
    step = 1e-6
    for axis in range(3):
        offset = torch.zeros(3, dtype=torch.float64)
        offset[axis] = step
        ahead = field.output(field.features(points + offset)).squeeze(1)
        behind = field.output(field.features(points - offset)).squeeze(1)
        assert torch.allclose(gradient[:, axis], (ahead - behind) / (2 * step), atol=1e-6)


def test_odd_number_of_layers_is_refused() -> None:
    with pytest.raises(ValueError, match="`hidden_layers` must be an even number >= 4, got 5"):
        FieldSettings(hidden_layers=5)
    with pytest.raises(ValueError, match=r"`dropout` must be in \[0, 1\), got 1.0"):
        FieldSettings(dropout=1.0)
    with pytest.raises(ValueError, match="`width` must be >= 1, got 0"):
        FieldSettings(width=0)
