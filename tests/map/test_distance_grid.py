import pytest
import torch
from torch import Tensor

from anm_gym.map.distance_grid import DistanceGrid
from anm_gym.map.settings import GridSettings

SETTINGS = GridSettings(voxel_m=0.1, band_m=1.0, noise_m=0.03, prior_std_m=0.3)
NORMAL = torch.tensor([0.6, 0.0, -0.8])


def plane(points: Tensor) -> Tensor:
    """Distance to an oblique plane."""
    return points @ NORMAL - 0.35


def nowhere(points: Tensor) -> Tensor:
    return torch.zeros(len(points))


def cloud(count: int, generator: torch.Generator) -> Tensor:
    return 2.0 * torch.rand((count, 3), generator=generator) - 1.0


def ones(points: Tensor) -> Tensor:
    return torch.ones(len(points))


@pytest.fixture
def fitted(generator: torch.Generator) -> DistanceGrid:
    """A grid that saw the plane from a wrong prior."""
    grid = DistanceGrid(SETTINGS)
    for _ in range(40):
        points = cloud(20_000, generator)
        grid.observe(points, plane(points), ones(points), nowhere)
    return grid


def test_plane_is_learned_to_two_millimetres(fitted: DistanceGrid, generator: torch.Generator) -> None:
    points = 0.8 * cloud(500, generator)
    predicted = fitted.refine(fitted.corners(points), torch.zeros(500))
    assert (predicted - plane(points)).abs().mean() < 2e-3


def test_exact_prior_is_left_as_it_is(generator: torch.Generator) -> None:
    grid, points = DistanceGrid(SETTINGS), cloud(1000, generator)
    grid.observe(points, plane(points), ones(points), plane)
    assert grid.change.abs().max() < 1e-5
    predicted = grid.refine(grid.corners(points), plane(points))
    assert (predicted - plane(points)).abs().max() < 0.02


def test_noise_is_averaged_away_until_the_limit_of_evidence(generator: torch.Generator) -> None:
    grid, corner = DistanceGrid(SETTINGS), torch.zeros((1, 3))
    for _ in range(25):
        noisy = 0.5 + 0.03 * torch.randn(1, generator=generator)
        grid.observe(corner, noisy, torch.ones(1), nowhere)
    predicted = grid.refine(grid.corners(corner), torch.zeros(1))
    assert abs(float(predicted) - 0.5) < 3.0 * 0.03 / 5.0


def test_grid_follows_a_change_in_the_end() -> None:
    grid, corner = DistanceGrid(SETTINGS), torch.zeros((1, 3))
    for distance in [0.5] * 200 + [0.1] * 200:
        grid.observe(corner, torch.tensor([distance]), torch.ones(1), nowhere)
    assert abs(float(grid.refine(grid.corners(corner), torch.zeros(1))) - 0.1) < 0.01


def test_posterior_variance_is_that_of_a_gaussian_mean() -> None:
    grid, corner = DistanceGrid(SETTINGS), torch.zeros((1, 3))
    assert torch.allclose(grid.variance(grid.corners(corner)), torch.tensor(0.3**2))
    for _ in range(9):
        grid.observe(corner, torch.tensor([0.2]), torch.ones(1), nowhere)
    exact = 1.0 / (9.0 / 0.03**2 + 1.0 / 0.3**2)
    assert torch.allclose(grid.variance(grid.corners(corner)), torch.tensor(exact))


def test_where_nothing_was_seen_the_prior_speaks(fitted: DistanceGrid) -> None:
    far = torch.tensor([[5.0, 0.0, 0.0], [0.0, -40.0, 3.0]])
    corners = fitted.corners(far)
    assert (fitted.known_share(corners) == 0.0).all()
    assert torch.equal(fitted.refine(corners, torch.tensor([0.7, -0.2])), torch.tensor([0.7, -0.2]))


def test_memory_grows_in_all_directions_and_keeps_what_it_held(generator: torch.Generator) -> None:
    grid = DistanceGrid(SETTINGS)
    places = [torch.tensor([x, y, z]) for x, y, z in [(0, 0, 0), (-9, 2, 7), (8, -3, -11), (1, 6, 30)]]
    for value, place in enumerate(places):
        grid.observe(place[None].float(), torch.tensor([float(value)]), torch.ones(1), nowhere)
    corners = grid.corners(torch.stack(places).float())
    assert torch.allclose(grid.refine(corners, torch.zeros(4)), torch.arange(4.0), rtol=0.011)


def test_weights_sum_to_one_and_find_the_point(fitted: DistanceGrid, generator: torch.Generator) -> None:
    points = cloud(50, generator)
    corners = fitted.corners(points)
    assert torch.allclose(corners.weights.sum(dim=1), torch.ones(50))
    positions = fitted._positions(corners.index.reshape(-1)).reshape(50, 8, 3)
    assert torch.allclose((corners.weights[..., None] * positions).sum(dim=1), points, atol=1e-5)


def test_gradient_is_the_planes_normal(fitted: DistanceGrid, generator: torch.Generator) -> None:
    points = (0.8 * cloud(100, generator)).requires_grad_()
    predicted = fitted.refine(fitted.corners(points), torch.zeros(100))
    (gradient,) = torch.autograd.grad(predicted.sum(), points)
    assert (gradient - NORMAL).norm(dim=1).mean() < 0.1


def test_perturbed_variance_is_that_of_independent_corners(
    fitted: DistanceGrid, generator: torch.Generator
) -> None:
    corners = fitted.corners(0.5 * cloud(3, generator))
    reference = fitted.refine(corners, torch.zeros(3))
    values, draws = fitted.values.clone(), []
    for _ in range(4000):
        fitted.values = values + 0.1 * torch.randn(values.shape, generator=generator)
        draws.append(fitted.refine(corners, torch.zeros(3)) - reference)
    fitted.values = values
    sampled = torch.stack(draws).var(dim=0)
    assert torch.allclose(fitted.perturbed_variance(corners, torch.tensor(0.1)), sampled, rtol=0.1)


def test_change_adds_up_all_steps_since_the_update_began() -> None:
    grid = DistanceGrid(SETTINGS)
    here, there = torch.zeros((1, 3)), torch.ones((1, 3))
    grid.observe(here, torch.tensor([0.3]), torch.ones(1), nowhere)
    grid.begin_update()
    assert not grid.change.any()
    grid.observe(here, torch.tensor([0.5]), torch.ones(1), nowhere)
    grid.observe(here, torch.tensor([0.7]), torch.ones(1), nowhere)
    grid.observe(there, torch.tensor([0.1]), torch.ones(1), nowhere)
    changes = grid.change[grid.change != 0.0]
    assert torch.allclose(changes.sort().values, torch.tensor([0.1, 0.2]))


def test_corners_seen_from_one_side_alone_are_taken_as_known() -> None:
    grid, center = DistanceGrid(SETTINGS), torch.full((20, 3), 0.05)
    grid.observe(center, torch.full((20,), 0.2), torch.ones(20), nowhere)
    corner = grid.corners(torch.zeros((1, 3)))
    assert torch.allclose(grid.variance(corner), torch.tensor(0.03**2 / (20 / 8 + 0.01)))


def test_no_observations_change_nothing() -> None:
    grid = DistanceGrid(SETTINGS)
    grid.observe(torch.zeros((0, 3)), torch.zeros(0), torch.zeros(0), nowhere)
    assert grid.num_weights == 0


def test_state_of_another_size_is_taken_over(fitted: DistanceGrid, generator: torch.Generator) -> None:
    other, points = DistanceGrid(SETTINGS), cloud(50, generator)
    other.load_state_dict(fitted.state_dict())
    priors = torch.zeros(50)
    assert torch.equal(
        other.refine(other.corners(points), priors), fitted.refine(fitted.corners(points), priors)
    )


def test_change_before_loading_is_forgotten_after_it(fitted: DistanceGrid) -> None:
    other = DistanceGrid(SETTINGS)
    other.load_state_dict(fitted.state_dict())
    other.begin_update()
    other.observe(torch.full((1, 3), 7.0), torch.tensor([0.5]), torch.ones(1), nowhere)
    assert torch.equal(other.change[other.change != 0.0], torch.tensor([0.5]))


def test_lengths_must_be_positive() -> None:
    with pytest.raises(ValueError, match="`voxel_m` must be > 0, got 0"):
        GridSettings(voxel_m=0.0, band_m=1.0, noise_m=0.1, prior_std_m=0.1)
