"""How true a map is about what its frames have shown, and whether it knows where it is not.

`anm_gym.metrics.map_accuracy` asks about the whole scene; here seen surface, crossed free space and the
map's own zero-crossings are told apart.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anm_gym.mesh import TriangleMesh
from anm_gym.metrics.completion import THRESHOLD_M, completion_samples
from anm_gym.metrics.depth_view import MIN_DEPTH_M, DepthView
from anm_gym.metrics.map_accuracy import SignedDistance
from anm_gym.metrics.ranking import auroc, ause

Distance = Callable[[NDArray[np.floating]], NDArray[np.floating]]
"""(N, 3) points to (N,) distances, metres: to what was observed, or to the true surface."""

SEEN_M: Final = 0.05
"""A zero-crossing this near to an observed point is seen, metres."""
UNSEEN_M: Final = 0.10
"""A zero-crossing farther than this from every observed point is unseen, metres."""
FAR_UNSEEN_M: Final = 0.30
"""One farther than this is unseen by far, metres."""
BEFORE_SURFACE_M: Final = 0.1
"""Free-space points keep this planar depth from the observed surface, metres."""


@dataclass(frozen=True, eq=False)
class Probes:
    """Points at which every map of the same frames is asked, with the true answers."""

    surface: NDArray[np.float64]
    """(N, 3) float64 area-uniform samples of the true surface, metres, world frame."""
    is_seen: NDArray[np.bool_]
    """(N,) bool: which of them the frames have shown."""
    free: NDArray[np.float32]
    """(M, 3) float32 points that rays have passed, metres, world frame."""
    free_m: NDArray[np.float64]
    """(M,) float64 their distance to the true surface, metres."""


@dataclass(frozen=True)
class MapQuality:
    """The signed distance of a map at the probes; NaN where there is no such probe."""

    mad_seen_cm: float
    """Mean absolute distance on seen surface, where it should be 0, centimetres."""
    mad_all_cm: float
    """Mean absolute distance on all surface, centimetres."""
    free_err_cm: float
    """Mean absolute error of the distance in free space, centimetres."""
    sign_err_pct: float
    """Share of free space that the map takes for solid, per cent."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """Zero-crossings of a map beside the truth about them."""

    vertices: NDArray[np.float32]
    """(V, 3) float32, metres, world frame."""
    observed_m: NDArray[np.float64]
    """(V,) float64 distance to the nearest observed point, metres."""
    true_m: NDArray[np.float64]
    """(V,) float64 distance to the true surface, metres."""

    def __len__(self) -> int:
        return len(self.vertices)


@dataclass(frozen=True)
class RankingScores:
    """How well a score sorts zero-crossings; NaN where a class is empty."""

    auroc_seen: float
    """Chance that unseen surface scores higher than seen surface."""
    auroc_far: float
    """Chance that surface unseen by far scores higher than seen surface."""
    auroc_false: float
    """Chance that a false zero-crossing scores higher than a true one."""
    ause: float
    """Area between sparsification by the score and by the true error, in units of the mean error."""


def make_probes(
    mesh: TriangleMesh,
    free: NDArray[np.float32],
    observed: Distance,
    true_distance: Distance,
    *,
    seen_m: float,
    num_surface: int,
) -> Probes:
    """Gather the points at which maps of the same frames are asked.

    Args:
        mesh: The true surface of the storey.
        free: (M, 3) float32 points of `free_space_points`, from all frames.
        observed: Distance to the nearest observed point.
        true_distance: Distance to the surface, `MeshDistance(mesh).distance_m`.
        seen_m: Surface nearer than this to an observed point is seen, metres.
        num_surface: Samples of the surface.

    Returns:
        The probes; the surface samples depend on the mesh and their number alone.
    """
    surface = completion_samples(mesh, num_surface).points
    return Probes(surface, _float64(observed(surface)) < seen_m, free, _float64(true_distance(free)))


def free_space_points(view: DepthView, count: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """Draw points along a frame's rays, clear of the surface that they hit.

    Args:
        view: The frame.
        count: How many points.
        rng: Draws pixels with replacement, and depths uniformly between 0.07 m and 0.1 m before the surface.

    Returns:
        (count, 3) float32, metres, world frame; none if no pixel shows that far.
    """
    depth_m = view.depth_m.ravel()
    pixels = np.flatnonzero(depth_m > MIN_DEPTH_M + BEFORE_SURFACE_M)
    if len(pixels) == 0:
        return np.zeros((0, 3), np.float32)
    drawn = rng.choice(pixels, count)
    along_m = rng.uniform(MIN_DEPTH_M, depth_m[drawn] - BEFORE_SURFACE_M)
    in_camera = view.directions.reshape(-1, 3)[drawn] * along_m[:, None]
    pose = view.world_from_camera
    return np.asarray(in_camera @ pose[:3, :3].T + pose[:3, 3], np.float32)


def map_quality(sdf: SignedDistance, probes: Probes) -> MapQuality:
    """Score a signed distance at the probes.

    Args:
        sdf: The map.
        probes: The points and the truth.

    Returns:
        Errors on seen and on all surface, and in free space.

    Source:
        Active Neural Mapping, Sec. 5.1 (MAD); restricted to what was seen, and free space, are ours.
    """
    on_surface_m = np.abs(_ask(sdf, probes.surface.astype(np.float32)))
    in_free_m = _ask(sdf, probes.free)
    return MapQuality(
        mad_seen_cm=100.0 * _mean(on_surface_m[probes.is_seen]),
        mad_all_cm=100.0 * _mean(on_surface_m),
        free_err_cm=100.0 * _mean(np.abs(in_free_m - probes.free_m)),
        sign_err_pct=100.0 * _mean(in_free_m <= 0.0),
    )


def label_crossings(vertices: NDArray[np.float32], observed: Distance, true_distance: Distance) -> Crossings:
    """Put the truth beside zero-crossings.

    Args:
        vertices: (V, 3) float32, metres, world frame.
        observed: Distance to the nearest observed point.
        true_distance: Distance to the true surface.

    Returns:
        The zero-crossings with both distances.
    """
    if len(vertices) == 0:
        return Crossings(vertices, np.zeros(0), np.zeros(0))
    return Crossings(vertices, _float64(observed(vertices)), _float64(true_distance(vertices)))


def rank_crossings(crossings: Crossings, scores: ArrayLike, seen_m: float = SEEN_M) -> RankingScores:
    """Measure how well a score of doubt tells unseen from seen and false from true surface.

    Args:
        crossings: Labelled zero-crossings. Those between seen and unseen enter neither class; false is
            what lies more than 5 cm from the true surface.
        scores: (V,) the score of each, such as neural variability.
        seen_m: Up to this distance to an observed point a zero-crossing is seen, metres.

    Returns:
        The rankings.

    Source:
        Ours. Active Neural Mapping, Sec. 4.2 claims what they measure.
    """
    values = np.asarray(scores, np.float64)
    return RankingScores(
        auroc_seen=_auroc_beyond(crossings.observed_m, values, seen_m, UNSEEN_M),
        auroc_far=_auroc_beyond(crossings.observed_m, values, seen_m, FAR_UNSEEN_M),
        auroc_false=auroc(values, crossings.true_m > THRESHOLD_M),
        ause=ause(values, crossings.true_m),
    )


def _auroc_beyond(
    distance_m: NDArray[np.float64], scores: NDArray[np.float64], near_m: float, far_m: float
) -> float:
    """Rank what lies beyond `far_m` against what lies within `near_m`."""
    is_far = distance_m > far_m
    is_asked = is_far | (distance_m <= near_m)
    return auroc(scores[is_asked], is_far[is_asked])


def _ask(sdf: SignedDistance, points: NDArray[np.float32]) -> NDArray[np.float64]:
    return _float64(sdf(points)) if len(points) else np.zeros(0)


def _mean(values: NDArray[np.floating] | NDArray[np.bool_]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _float64(values: NDArray[np.floating]) -> NDArray[np.float64]:
    return np.asarray(values, np.float64)
