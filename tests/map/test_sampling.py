import torch

from anm_gym.map.frames import FrameStore
from anm_gym.map.sampling import sample_rays
from anm_gym.map.settings import SamplingSettings


def test_first_sample_is_the_surface_and_bounds_are_distances_to_it(
    store: FrameStore, generator: torch.Generator
) -> None:
    settings = SamplingSettings()
    pixels = store.sample_pixels(torch.arange(5), 50, generator)
    rays = sample_rays(pixels, settings, generator)
    assert rays.points.shape == (len(pixels.depth_m), 27, 3)
    assert torch.allclose(rays.points[:, 0], pixels.surface, atol=1e-6)
    distance = (rays.points - pixels.surface[:, None]).norm(dim=2)
    assert torch.allclose(rays.ray_bound_m.abs(), distance, atol=1e-5)


def test_no_sample_lies_farther_behind_than_allowed(store: FrameStore, generator: torch.Generator) -> None:
    settings = SamplingSettings(behind_m=0.05)
    pixels = store.sample_pixels(torch.arange(5), 50, generator)
    rays = sample_rays(pixels, settings, generator)
    behind_depth = -rays.ray_bound_m / pixels.directions.norm(dim=1, keepdim=True)
    assert behind_depth.max() <= 0.05 + 1e-5


def test_a_window_with_few_frames_shares_out_its_rays() -> None:
    ours = SamplingSettings(window_frames=8, rays_per_frame=24, fill_window=True)
    assert [ours.rays_of_each(count) for count in (1, 2, 8)] == [192, 96, 24]
    assert SamplingSettings().rays_of_each(1) == 200


def test_stratified_samples_cover_the_whole_ray(store: FrameStore, generator: torch.Generator) -> None:
    pixels = store.sample_pixels(torch.arange(5), 50, generator)
    rays = sample_rays(pixels, SamplingSettings(near_surface=1, stratified=10), generator)
    depths = (rays.points[:, 1:] - pixels.origins[:, None]).norm(dim=2)
    assert (depths.diff(dim=1) > 0).all()
