"""The test that makes a keyframe: how much of a frame an older copy of the map explains."""

from dataclasses import replace

import torch
from torch import Tensor

from anm_gym.map.fields import Field
from anm_gym.map.frames import PixelBatch
from anm_gym.map.sampling import sample_rays
from anm_gym.map.settings import KeyframeSettings, SamplingSettings

RENDER_BEHIND_M = 0.8
"""How far behind the surface the rendered rays are followed, metres of depth (released code)."""


@torch.no_grad()
def explained_share(
    field: Field,
    pixels: PixelBatch,
    settings: KeyframeSettings,
    sampling: SamplingSettings,
    generator: torch.Generator,
) -> float:
    """Measure which share of pixels a frozen map predicts.

    Args:
        field: The frozen field.
        pixels: Pixels of the frame.
        settings: Which test and its tolerance.
        sampling: Samples per ray of the `render` test.
        generator: Source of randomness.

    Returns:
        Share in [0, 1]; 1 for a frame without valid pixels, which can teach nothing.

    Source:
        iSDF's keyframe test (`render`); `surface` is ours.
    """
    if len(pixels.depth_m) == 0:
        return 1.0
    if settings.test == "surface":
        error = field(pixels.surface).abs()
    else:
        error = (_render_depth(field, pixels, sampling, generator) - pixels.depth_m).abs()
    return float((error < settings.relative_error * pixels.depth_m).float().mean())


def _render_depth(
    field: Field, pixels: PixelBatch, sampling: SamplingSettings, generator: torch.Generator
) -> Tensor:
    """(R,) depth of the first sample behind a predicted surface, corrected by its distance; 0 if none."""
    rays = sample_rays(pixels, replace(sampling, behind_m=RENDER_BEHIND_M), generator)
    length = pixels.directions.norm(dim=1, keepdim=True)
    depths, order = (pixels.depth_m[:, None] - rays.ray_bound_m / length).sort(dim=1)
    values = field(rays.points.reshape(-1, 3)).reshape(depths.shape).gather(1, order)
    is_behind = values < 0.0
    first = is_behind.float().argmax(dim=1, keepdim=True)
    depth = (depths + values).gather(1, first).squeeze(1)
    return torch.where(is_behind.any(dim=1), depth, 0.0)
