import torch
from torch import Tensor, nn

from anm_gym.map.frames import PixelBatch
from anm_gym.map.losses import distance_bound, distance_loss, map_loss
from anm_gym.map.sampling import RayBatch
from anm_gym.map.settings import LossSettings

WALL_Z = -2.0


class ExactWall(nn.Module):
    """The true distance to the wall z = -2."""

    def forward(
        self, points: Tensor, output_noise: Tensor | None = None, dropout: torch.Generator | None = None
    ) -> Tensor:
        distance = points[:, 2] - WALL_Z
        return distance if output_noise is None else distance + output_noise


def oblique_rays() -> RayBatch:
    """Rays from the origin at 45 degrees onto the wall z = -2, sampled at five depths."""
    count = 8
    directions = torch.tensor([1.0, 0.0, -1.0]).expand(count, 3)
    depth = torch.full((count,), 2.0)
    pixels = PixelBatch(
        torch.zeros(count, dtype=torch.int64), depth, torch.zeros(count, 3), directions,
        torch.tensor([0.0, 0.0, 1.0]).expand(count, 3),
    )  # fmt: skip
    depths = torch.tensor([2.0, 0.5, 1.0, 1.9, 2.05]).expand(count, 5)
    return RayBatch(pixels, depths[..., None] * directions[:, None], (2.0 - depths) * 2.0**0.5)


def to_wall(points: Tensor) -> Tensor:
    return (points[:, 2] - WALL_Z).abs()


def test_ray_bound_overestimates_and_normal_bound_is_exact_on_a_plane() -> None:
    rays = oblique_rays()
    truth = rays.points[..., 2] - WALL_Z
    ray = distance_bound(rays, "ray", to_wall)
    assert torch.allclose(ray, truth * 2.0**0.5, atol=1e-5)
    for kind in ("normal", "cloud"):
        assert torch.allclose(distance_bound(rays, kind, to_wall), truth, atol=1e-5)


def test_cloud_bound_sees_a_nearer_surface_beside_the_ray() -> None:
    rays = oblique_rays()
    bound = distance_bound(rays, "cloud", lambda points: torch.full((len(points),), 0.2))
    assert bound.abs().max() <= 0.2 + 1e-6
    assert bound[0, 4] < 0.0


def test_batch_bound_is_the_distance_to_the_nearest_sample() -> None:
    rays = oblique_rays()
    bound = distance_bound(rays, "batch", to_wall)
    expected = (rays.points - rays.pixels.surface[0]).norm(dim=2)
    assert torch.allclose(bound.abs(), expected, atol=1e-5)
    assert bound[0, 4] < 0.0 < bound[0, 1]


def test_free_space_is_free_of_loss_between_zero_and_its_bound() -> None:
    settings = LossSettings()
    bound = torch.tensor([1.0, 1.0, 1.0, 0.1])
    prediction = torch.tensor([0.5, 1.4, -0.1, 0.2])
    loss = distance_loss(prediction, bound, settings)
    expected = torch.tensor([0.0, 0.4, float(torch.exp(torch.tensor(0.5))) - 1.0, 5.38344 * 0.1])
    assert torch.allclose(loss, expected, atol=1e-5)


def test_regressed_free_space_is_held_to_its_bound() -> None:
    loss = distance_loss(torch.tensor([0.5]), torch.tensor([1.0]), LossSettings(regress_free_space=True))
    assert torch.allclose(loss, torch.tensor([0.5]))


def test_exact_distance_has_no_loss_but_that_of_the_rays_direction() -> None:
    rays = oblique_rays()
    bound = distance_bound(rays, "normal", to_wall)
    terms = map_loss(ExactWall(), rays, bound, LossSettings(), None)
    assert terms.distance < 1e-5
    assert terms.eikonal < 1e-5
    along_ray = 1.0 - 0.5**0.5
    assert torch.allclose(terms.normal, torch.tensor(0.018 * along_ray * 4 / 5), atol=1e-5)
    assert terms.per_ray.shape == (8,)


def test_a_share_of_the_rays_gives_the_same_distance_term() -> None:
    rays = oblique_rays()
    bound = distance_bound(rays, "ray", to_wall)
    noise = 0.01 * torch.ones(8, 5)
    whole = map_loss(ExactWall(), rays, bound, LossSettings(), noise)
    part = map_loss(ExactWall(), rays, bound, LossSettings(gradient_share=0.25), noise)
    assert torch.allclose(whole.distance, part.distance)
    assert torch.allclose(whole.total, whole.distance + whole.eikonal + whole.normal)
