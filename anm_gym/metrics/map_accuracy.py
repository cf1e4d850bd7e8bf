"""How true a map is: its signed distance on the true surface, and its reconstruction near it.

Completion, which measures the path, is in `anm_gym.metrics.completion`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from anm_gym.mesh import TriangleMesh
from anm_gym.metrics.completion import NUM_SAMPLES, THRESHOLD_M, completion_samples
from anm_gym.metrics.distance import MeshDistance
from anm_gym.metrics.samples import sample_surface

SignedDistance = Callable[[NDArray[np.float32]], NDArray[np.floating]]
"""(N, 3) float32 points to (N,) signed distances, metres."""

CEILING_CUT_M: Final = 0.8
"""Top of the true mesh that the released evaluation of Active Neural Mapping leaves out, metres."""

_POINTS_PER_CALL: Final = 65_536


@dataclass(frozen=True)
class FieldScores:
    """The signed distance of the map at the true surface, where it should be 0."""

    mad_cm: float
    """Mean absolute distance over area-uniform samples of the surface, centimetres."""
    mad_official_cm: float
    """Mean absolute distance over the true mesh's vertices without the storey's top 0.8 m, centimetres."""


@dataclass(frozen=True)
class ReconstructionScores:
    """The distance of the reconstructed mesh from the true surface."""

    acc_cm: float
    """Mean exact distance of its area-uniform samples to the true triangles, centimetres."""
    fpr_pct: float
    """False positive rate: share of those samples 5 cm or more away, per cent."""
    fpr_official_pct: float
    """Share of the samples 5 cm or more from each of 200 000 samples of the true surface, per cent."""
    fpr_floor_pct: float
    """The official rate of a perfect reconstruction, see `sampling_floor_pct`."""


def field_scores(
    sdf: SignedDistance,
    true_mesh: TriangleMesh,
    num_samples: int = NUM_SAMPLES,
    top_y_m: float | None = None,
) -> FieldScores:
    """Score a signed distance on the true surface.

    Args:
        sdf: The map, called with at most 65 536 points at a time.
        true_mesh: The true surface of the storey.
        num_samples: Samples of the surface.
        top_y_m: How high the storey reaches, metres; None for as high as the mesh.

    Returns:
        Native and official scores. The official one is not a number if nothing lies below its cut.

    Source:
        Active Neural Mapping, Sec. 5.1 (MAD) and its released evaluation.
    """
    error_m = _absolute_m(sdf, completion_samples(true_mesh, num_samples).points)
    vertices = true_mesh.vertices[np.unique(true_mesh.faces)]
    highest_m = true_mesh.bounds[1, 1] if top_y_m is None else top_y_m
    kept = vertices[vertices[:, 1] <= highest_m - CEILING_CUT_M]
    return FieldScores(_mean_cm(error_m), _mean_cm(_absolute_m(sdf, kept)))


def reconstruction_scores(
    vertices: NDArray[np.floating],
    faces: NDArray[np.integer],
    true_mesh: TriangleMesh,
    rng: np.random.Generator,
    num_samples: int = NUM_SAMPLES,
    true_distance: MeshDistance | None = None,
) -> ReconstructionScores:
    """Score a reconstructed mesh against the true surface.

    Args:
        vertices: (V, 3) of the reconstruction, metres, world frame.
        faces: (F, 3) indices; without area the scores are not a number.
        true_mesh: The true surface.
        rng: Draws the samples.
        num_samples: Samples of the reconstruction, and of the true surface for the official scores.
        true_distance: Distance to the true surface, where that is more than `true_mesh`: stairwells show
            surface of other storeys. None for `MeshDistance(true_mesh)`.

    Returns:
        Native (point to triangle) and official (sample to sample) scores.

    Source:
        Active Neural Mapping, Sec. 5.1 (FPR, Acc.) and its released evaluation.
    """
    true_samples = sample_surface(true_mesh, num_samples, rng).points
    floor_pct = sampling_floor_pct(num_samples, float(true_mesh.areas_m2.sum()))
    nothing = ReconstructionScores(np.nan, np.nan, np.nan, floor_pct)
    if len(faces) == 0:
        return nothing
    mesh = TriangleMesh(np.asarray(vertices, np.float64), np.asarray(faces, np.int32))
    if not mesh.areas_m2.sum() > 0.0:
        return nothing
    points = sample_surface(mesh, num_samples, rng).points
    native_m = (true_distance or MeshDistance(true_mesh)).distance_m(points)
    official_m, _ = cKDTree(true_samples).query(points)
    return ReconstructionScores(
        acc_cm=_mean_cm(native_m),
        fpr_pct=100.0 - _below_pct(native_m),
        fpr_official_pct=100.0 - _below_pct(official_m),
        fpr_floor_pct=floor_pct,
    )


def sampling_floor_pct(num_samples: int, area_m2: float, radius_m: float = THRESHOLD_M) -> float:
    """Chance that a point of a flat surface has none of N area-uniform samples around it, per cent.

    This is the false positive rate that the sample-to-sample measure gives a perfect reconstruction.

    Args:
        num_samples: Samples of the surface, N.
        area_m2: Its area, square metres.
        radius_m: Distance that counts as near, metres.

    Example:
        >>> round(sampling_floor_pct(200_000, 800.0), 1)
        14.0
    """
    return float(100.0 * np.exp(-num_samples / area_m2 * np.pi * radius_m**2))


def _absolute_m(sdf: SignedDistance, points: NDArray[np.float64]) -> NDArray[np.float64]:
    starts = range(0, len(points), _POINTS_PER_CALL)
    parts = [sdf(points[start : start + _POINTS_PER_CALL].astype(np.float32)) for start in starts]
    return np.abs(np.concatenate([np.zeros(0), *parts]).astype(np.float64))


def _mean_cm(distance_m: NDArray[np.floating]) -> float:
    return float(100.0 * distance_m.mean()) if len(distance_m) else float("nan")


def _below_pct(distance_m: NDArray[np.floating]) -> float:
    return float(100.0 * (distance_m < THRESHOLD_M).mean()) if len(distance_m) else float("nan")
