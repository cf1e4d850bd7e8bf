"""Whether a neural map knows where it is wrong: its zero-crossings and its frames against the truth.

The measures are those of `anm_gym.metrics.map_quality`; here a `NeuralMap` is asked for what they need.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.volume import UNKNOWN
from anm_gym.map.zero_crossings import Lattice, zero_crossings_of
from anm_gym.mesh import TriangleMesh
from anm_gym.metrics.depth_view import DepthView, depth_view
from anm_gym.metrics.distance import MeshDistance
from anm_gym.metrics.map_quality import (
    SEEN_M,
    free_space_points,
    label_crossings,
    make_probes,
    map_quality,
    rank_crossings,
)
from anm_gym.metrics.ranking import reliability
from train.results import Row

MARGIN_M: Final = 1.0
"""How far into unknown space zero-crossings are followed, metres, as far as the view planner does."""

NUM_CROSSINGS: Final = 2000
"""Zero-crossings that are ranked, at most."""
NUM_FREE: Final = 5000
"""Points on the rays of the kept frames, about; each costs a search for the nearest true surface."""
NUM_SURFACE: Final = 20_000
"""Samples of the true surface."""

_SEED: Final = 0
_LATTICE_M: Final = 0.2
_CLOUD_SLACK_M: Final = 0.01
"""The map's cloud keeps one point per 5 cm voxel, so distances to it are a little too large."""


def calibration_scores(neural_map: NeuralMap, mesh: TriangleMesh, true_distance: MeshDistance) -> Row:
    """Score what a map says about its own frames, and whether its variability shows where it errs.

    Args:
        neural_map: A map at the end of an episode.
        mesh: The true surface of the storey.
        true_distance: Distance to the true surface, that of other storeys included.

    Returns:
        `mad_seen_cm`, `free_err_cm`, `sign_err_pct`, `auroc_seen`, `auroc_false`, `ause` and
        `reliability`, a list of [predicted standard deviation (m), root mean square error (m), count].
        Empty if the map has observed no surface.
    """
    if len(neural_map.cloud) == 0:
        return {}
    rng, seen_m = np.random.default_rng(_SEED), SEEN_M + _CLOUD_SLACK_M
    views = list(views_of(neural_map))
    free = np.concatenate([free_space_points(view, -(-NUM_FREE // len(views)), rng) for view in views])
    observed, truth = neural_map.cloud.distance_of, true_distance.distance_m
    probes = make_probes(mesh, free, observed, truth, seen_m=seen_m, num_surface=NUM_SURFACE)
    quality = map_quality(neural_map.sdf, probes)
    vertices = considered_crossings(neural_map, _LATTICE_M, NUM_CROSSINGS, rng)
    crossings = label_crossings(vertices, observed, truth)
    scores = neural_map.variability(vertices) if len(vertices) else np.zeros(0, np.float32)
    ranking = rank_crossings(crossings, scores, seen_m)
    std_m = predicted_std_m(scores, neural_map.settings.variability.statistic)
    bins = reliability(std_m, crossings.true_m)
    return {
        "mad_seen_cm": quality.mad_seen_cm,
        "free_err_cm": quality.free_err_cm,
        "sign_err_pct": quality.sign_err_pct,
        "auroc_seen": ranking.auroc_seen,
        "auroc_false": ranking.auroc_false,
        "ause": ranking.ause,
        "reliability": np.stack([bins.predicted_std_m, bins.rms_error_m, bins.counts], axis=1).tolist(),
    }


def views_of(neural_map: NeuralMap) -> Iterator[DepthView]:
    """Yield the frames that a map keeps, oldest first."""
    camera, state = neural_map.camera, neural_map.frames.state()
    shape = (-1, camera.height_px, camera.width_px)
    depths_m = state["depths"].float().cpu().numpy().reshape(shape)
    for depth_m, pose in zip(depths_m, state["poses"].cpu().numpy(), strict=True):
        yield depth_view(depth_m, camera, pose)


def considered_crossings(
    neural_map: NeuralMap, lattice_m: float, max_count: int, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Extract the zero-crossings that an agent may consider, seen ones among them.

    Args:
        neural_map: A map that has observed a surface.
        lattice_m: Spacing of the lattice, metres.
        max_count: More of them are thinned out at random.
        rng: Thins them out.

    Returns:
        (V, 3) float32 vertices within 1 m of the space that rays have passed or hit, metres, world frame.
    """
    margin_m = np.array([MARGIN_M, lattice_m, MARGIN_M])
    bounds = neural_map.cloud.bounds(0.001) + np.stack([-margin_m, margin_m])
    lattice = Lattice.with_spacing(bounds, lattice_m)
    points = lattice.points
    is_unknown = neural_map.volume.state_at(points).reshape(lattice.shape) == UNKNOWN
    to_known_m = ndimage.distance_transform_edt(is_unknown, sampling=lattice_m)
    is_asked = to_known_m <= MARGIN_M + 2.0 * lattice_m  # all corners of the cells that count
    values = np.ones(lattice.shape, np.float32)
    values[is_asked] = neural_map.sdf(points[is_asked.ravel()])
    vertices = zero_crossings_of(values, lattice, to_known_m <= MARGIN_M).vertices
    if len(vertices) <= max_count:
        return vertices
    return vertices[np.sort(rng.choice(len(vertices), max_count, replace=False))]


def predicted_std_m(variability: NDArray[np.float32], statistic: str) -> NDArray[np.float64]:
    """Read a score as a standard deviation of the signed distance.

    Args:
        variability: (N,) what `NeuralMap.variability` returned.
        statistic: ``"variance"``, or ``"mean_absolute"``, taken for that of a Gaussian.

    Returns:
        (N,) float64 metres.
    """
    scores = np.asarray(variability, np.float64)
    return np.sqrt(scores) if statistic == "variance" else np.sqrt(np.pi / 2.0) * scores
