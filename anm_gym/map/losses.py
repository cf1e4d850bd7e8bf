"""Distance targets and the three terms of the map's loss (Active Neural Mapping, Eq. 3)."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from anm_gym.map.fields import NetworkField
from anm_gym.map.sampling import RayBatch
from anm_gym.map.settings import DistanceTarget, LossSettings

CloudDistance = Callable[[Tensor], Tensor]
"""Maps (N, 3) points to their (N,) unsigned distance from the observed surface cloud, metres."""

CLOUD_FROM_M = 0.15
"""Samples farther in front of their surface ask for the nearest point of the cloud, metres."""
MIN_COSINE = 0.1
"""Normals at the edges of things may be perpendicular to the ray; the distance then must not vanish."""
CLOUD_SPACING_M = 0.04
"""By so much the distance to the nearest point of the cloud may exceed that to its surface, metres."""
CLOUD_SPREAD = 0.01
"""And by so much more per metre of depth, as pixels lie farther apart."""


@dataclass(frozen=True)
class LossTerms:
    """Means over the samples, already weighted."""

    distance: Tensor
    """Scalar: free-space and near-surface supervision."""
    eikonal: Tensor
    """Scalar: | ||gradient|| - 1 |."""
    normal: Tensor
    """Scalar: 1 - cos(gradient, normal)."""
    per_ray: Tensor
    """(R,) detached mean distance loss of each ray, for weighted replay."""

    @property
    def total(self) -> Tensor:
        """Scalar to be minimised."""
        return self.distance + self.eikonal + self.normal


def distance_bound(rays: RayBatch, kind: DistanceTarget, cloud_distance: CloudDistance) -> Tensor:
    """Bound the signed distance at every sample.

    Args:
        rays: (R, S) samples.
        kind: `ray`: distance along the ray; `normal`: that times the cosine between ray and surface
            normal; `batch`: distance to the nearest surface sample of the batch; `cloud`: `normal`,
            held in front of the surface within what the distance to everything observed so far allows
            (ours).
        cloud_distance: Distance to the observed cloud, used by `cloud` alone.

    Returns:
        (R, S) float32 metres, negative behind the observed surface.

    Source:
        iSDF, Sec. III-C, as used by Active Neural Mapping, Sec. 4.1.
    """
    bound = rays.ray_bound_m
    if kind == "ray":
        return bound
    if kind == "batch":
        nearest = torch.cdist(rays.points.reshape(-1, 3), rays.pixels.surface).amin(dim=1)
        return torch.where(bound < 0.0, -1.0, 1.0) * nearest.reshape(bound.shape)
    direction = torch.nn.functional.normalize(rays.pixels.directions, dim=1)
    cosine = (direction * rays.pixels.normals).sum(dim=1, keepdim=True).abs()
    planar = bound * cosine
    if kind == "normal":
        return planar
    far = torch.nonzero((bound > CLOUD_FROM_M).reshape(-1))[:, 0]
    nearest = cloud_distance(rays.points.reshape(-1, 3)[far])
    spacing = CLOUD_SPACING_M + CLOUD_SPREAD * rays.pixels.depth_m[far // bound.shape[1]]
    highest = torch.minimum(bound.reshape(-1)[far], nearest)
    lowest = torch.minimum(nearest - spacing, highest)
    planar = (bound * cosine.clamp(min=MIN_COSINE)).reshape(-1)
    held = torch.maximum(torch.minimum(planar[far], highest), lowest)
    return planar.index_copy(0, far, held).reshape(bound.shape)


def distance_loss(prediction: Tensor, bound: Tensor, settings: LossSettings) -> Tensor:
    """Supervise predictions by bounds, elementwise.

    Near the surface the distance is regressed; in free space it must lie between 0 and its bound.

    Args:
        prediction: Signed distances, metres.
        bound: Bounds of the same shape, metres.
        settings: Truncation and weights.

    Returns:
        Losses of the same shape.

    Source:
        Active Neural Mapping, Eq. 3 (first two cases); `regress_free_space` is ours.
    """
    error = (prediction - bound).abs()
    near = settings.truncated_weight * error
    if settings.regress_free_space:
        return torch.where(bound > settings.truncation_m, error, near)
    above = torch.relu(prediction - bound)
    below = torch.expm1((-settings.free_space_decay * prediction).clamp(max=10.0))
    return torch.where(bound > settings.truncation_m, torch.maximum(above, below), near)


def map_loss(
    field: NetworkField,
    rays: RayBatch,
    bound: Tensor,
    settings: LossSettings,
    output_noise: Tensor | None,
    dropout: torch.Generator | None = None,
) -> LossTerms:
    """Evaluate Eq. 3 on a batch of rays.

    Args:
        field: The network.
        rays: (R, S) samples.
        bound: (R, S) float32 from `distance_bound`, metres.
        settings: Weights; `gradient_share` of the rays enter the gradient terms.
        output_noise: (R, S) noise on the raw output, or None.
        dropout: Draws which units are dropped; None drops none.

    Returns:
        The weighted terms.

    Source:
        Active Neural Mapping, Eq. 3; normals are in the world frame and point out of the surface.
    """
    count = max(1, round(settings.gradient_share * len(rays.points)))
    noise = (None, None) if output_noise is None else (output_noise[:count], output_noise[count:])
    points = rays.points[:count].reshape(-1, 3).requires_grad_()
    with_gradient = field(points, None if noise[0] is None else noise[0].reshape(-1), dropout)
    (gradient,) = torch.autograd.grad(with_gradient.sum(), points, create_graph=True)
    prediction = with_gradient.reshape(count, -1)
    if count < len(rays.points):
        rest_noise = None if noise[1] is None else noise[1].reshape(-1)
        rest = field(rays.points[count:].reshape(-1, 3), rest_noise, dropout)
        prediction = torch.cat([prediction, rest.reshape(len(rays.points) - count, -1)])
    distance = distance_loss(prediction, bound, settings)
    gradient = gradient.reshape(count, -1, 3)
    return LossTerms(
        distance=distance.mean(),
        eikonal=settings.eikonal_weight * _eikonal(gradient, bound[:count] >= settings.eikonal_min_m),
        normal=settings.normal_weight * _normal(gradient, rays, count),
        per_ray=distance.detach().mean(dim=1),
    )


def _eikonal(gradient: Tensor, applies: Tensor) -> Tensor:
    """Mean over all samples of | ||gradient|| - 1 | where it applies."""
    deviation: Tensor = (gradient.norm(dim=-1) - 1.0).abs() * applies
    return deviation.mean()


def _normal(gradient: Tensor, rays: RayBatch, count: int) -> Tensor:
    """Mean of 1 - cos: the surface normal at the surface sample, against the ray elsewhere."""
    towards = -rays.pixels.directions[:count, None].expand(gradient.shape).clone()
    towards[:, 0] = rays.pixels.normals[:count]
    return (1.0 - torch.cosine_similarity(gradient, towards, dim=-1)).mean()
