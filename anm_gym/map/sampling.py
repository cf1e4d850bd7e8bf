"""Points along the rays of drawn pixels, at which the field is supervised."""

from dataclasses import dataclass

import torch
from torch import Tensor

from anm_gym.map.frames import PixelBatch
from anm_gym.map.settings import SamplingSettings


@dataclass(frozen=True)
class RayBatch:
    """S samples on each of R rays; sample 0 lies on the observed surface."""

    pixels: PixelBatch
    """The pixels that the rays belong to."""
    points: Tensor
    """(R, S, 3) float32, metres, world frame."""
    ray_bound_m: Tensor
    """(R, S) float32 distance along the ray to its surface, metres, negative behind it."""

    def first(self, count: int) -> "RayBatch":
        """The first rays; as the frames take turns, they hold all frames evenly."""
        return RayBatch(self.pixels.first(count), self.points[:count], self.ray_bound_m[:count])


def sample_rays(pixels: PixelBatch, settings: SamplingSettings, generator: torch.Generator) -> RayBatch:
    """Place surface, near-surface and stratified samples on each ray.

    Args:
        pixels: R pixels with depth.
        settings: Counts and spreads; depths, not ranges, are drawn.
        generator: Source of randomness.

    Returns:
        The samples, surface first.

    Source:
        iSDF's sampling, as used by Active Neural Mapping, Sec. 4.1.
    """
    depth = pixels.depth_m[:, None]
    device, rays = depth.device, len(depth)
    farthest = depth + settings.behind_m
    noise = torch.randn((rays, settings.near_surface - 1), generator=generator, device=device)
    near = (depth + settings.near_surface_std_m * noise).clamp(min=settings.min_depth_m)
    bins = torch.arange(settings.stratified, device=device)
    jitter = torch.rand((rays, settings.stratified), generator=generator, device=device)
    stratified = settings.min_depth_m + (bins + jitter) / settings.stratified * (
        farthest - settings.min_depth_m
    )
    depths = torch.cat([depth, torch.minimum(near, farthest), stratified], dim=1)
    points = pixels.origins[:, None] + depths[..., None] * pixels.directions[:, None]
    return RayBatch(pixels, points, (depth - depths) * pixels.directions.norm(dim=1, keepdim=True))
