"""Measure a learned map against the truth of its recording, and its families of variability on that map."""

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anm_gym.map.cloud import SurfaceCloud
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.presets import DRAWS, USUAL_DRAWS
from anm_gym.mesh import TriangleMesh
from anm_gym.metrics.depth_view import depth_view
from anm_gym.metrics.distance import MeshDistance
from anm_gym.metrics.map_accuracy import reconstruction_scores
from anm_gym.metrics.map_quality import (
    Crossings,
    Probes,
    free_space_points,
    label_crossings,
    make_probes,
    map_quality,
    rank_crossings,
)
from benchmarks.learning import Learned
from benchmarks.recordings import Recording
from train.calibration import considered_crossings
from train.results import Row

CLOUD_VOXEL_M = 0.01
"""One observed point is kept per cube of this side, metres."""
SURFACE_SEEN_M = 0.02
"""Surface nearer than this to an observed point is seen, metres."""
LATTICE_M = 0.1
"""Spacing of the lattice on which zero-crossings are extracted, metres."""
TIMED_POINTS = 1000
"""Points of one timed call of `variability`."""
SEED = 0
"""Seed of every draw of the measures."""

_TIMED_CALLS = 3


@dataclass(frozen=True)
class Effort:
    """How many points the measures take."""

    surface: int = 100_000
    """Samples of the true surface."""
    free_per_frame: int = 100
    """Points on the rays of each frame."""
    crossings: int = 4000
    """Zero-crossings that are ranked, at most."""
    reconstruction: int = 50_000
    """Samples of the reconstructed surface."""


QUICK = Effort(surface=20_000, free_per_frame=50, crossings=1000, reconstruction=10_000)
"""Enough for a first look."""


@dataclass(frozen=True, eq=False)
class Truth:
    """What every map of one recording is measured against."""

    mesh: TriangleMesh
    """The true surface of the storey."""
    distance: MeshDistance
    """Distance to the true surface, that of other storeys included."""
    observed: SurfaceCloud
    """Everything that the frames have shown."""
    probes: Probes
    """Points at which the maps are asked."""


def make_truth(recording: Recording, effort: Effort) -> Truth:
    """Gather all frames of a recording into the truth about it."""
    rng, mesh = np.random.default_rng(SEED), recording.scene.storey_mesh
    observed, free = SurfaceCloud(voxel_m=CLOUD_VOXEL_M), []
    for depth_m, pose in zip(recording.depth_m, recording.world_from_camera, strict=True):
        view = depth_view(depth_m, recording.camera, pose)
        observed.add(view.points)
        free.append(free_space_points(view, effort.free_per_frame, rng))
    distance = MeshDistance(recording.scene.mesh)
    probes = make_probes(
        mesh,
        np.concatenate(free),
        observed.distance_of,
        distance.distance_m,
        seen_m=SURFACE_SEEN_M,
        num_surface=effort.surface,
    )
    return Truth(mesh, distance, observed, probes)


def score_map(learned: Learned, truth: Truth, families: Sequence[str], effort: Effort) -> list[Row]:
    """Measure a map, and rank its zero-crossings by each family of variability.

    Args:
        learned: The map and what it cost.
        truth: The truth of its recording.
        families: Families to score; those that the map does not allow are left out.
        effort: How many points to take.

    Returns:
        One row per family; what is about the map is the same in all of them.
    """
    neural_map, rng = learned.neural_map, np.random.default_rng(SEED)
    about_map = _costs(learned) | _accuracy(neural_map, truth, effort)
    vertices = considered_crossings(neural_map, LATTICE_M, effort.crossings, rng)
    crossings = label_crossings(vertices, truth.observed.distance_of, truth.distance.distance_m)
    rows = []
    for family in families:
        ranking = _ranking(neural_map, crossings, family)
        if ranking is not None:
            rows.append(about_map | {"family": family, "crossings": len(crossings)} | ranking)
    return rows


def _costs(learned: Learned) -> Row:
    neural_map, cost = learned.neural_map, learned.cost
    sampling = neural_map.settings.sampling
    window = sampling.window_frames * sampling.rays_per_frame * sampling.samples_per_ray
    filled_in = sampling.fill_in_rays * sampling.near_surface if neural_map.field.grids() else 0
    return {
        "preset": neural_map.settings.preset,
        "field": neural_map.field.name,
        "settings_hash": neural_map.settings.settings_hash,
        "steps": cost.steps,
        "iterations": cost.iterations,
        "points_step": window * cost.iterations / cost.steps + filled_in,
        "cpu_ms_step": cost.cpu_ms_step,
        "observe_ms_step": cost.observe_ms_step,
        "wall_ms_step": cost.wall_ms_step,
        "flops_step": cost.flops_step,
        "memory_mb": sum(tensor.nbytes for tensor in neural_map.state().values()) / 1e6,
    }


def _accuracy(neural_map: NeuralMap, truth: Truth, effort: Effort) -> Row:
    quality, surface = map_quality(neural_map.sdf, truth.probes), neural_map.mesh()
    mesh = reconstruction_scores(
        surface.vertices,
        surface.faces,
        truth.mesh,
        np.random.default_rng(SEED),
        effort.reconstruction,
        truth.distance,
    )
    return {
        "mad_seen_cm": quality.mad_seen_cm,
        "mad_all_cm": quality.mad_all_cm,
        "free_err_cm": quality.free_err_cm,
        "sign_err_pct": quality.sign_err_pct,
        "fpr_pct": mesh.fpr_pct,
        "acc_cm": mesh.acc_cm,
    }


def _ranking(neural_map: NeuralMap, crossings: Crossings, family: str) -> Row | None:
    """Rank by one family; None if the field does not allow it."""
    settings = neural_map.settings
    own = settings.variability
    if family != own.family:
        draws: dict[str, Any] = {"family": family, "draws": DRAWS.get(family, USUAL_DRAWS)}
        neural_map.settings = replace(settings, variability=replace(own, **draws))
    try:
        scores = neural_map.variability(crossings.vertices)
        variability_ms = _variability_ms(neural_map, crossings.vertices)
    except ValueError as error:
        if repr(family) not in str(error):
            raise
        return None
    finally:
        neural_map.settings = settings
    ranking = rank_crossings(crossings, scores)
    return {
        "auroc_seen": ranking.auroc_seen,
        "auroc_far": ranking.auroc_far,
        "auroc_false": ranking.auroc_false,
        "ause": ranking.ause,
        "variability_ms": variability_ms,
    }


def _variability_ms(neural_map: NeuralMap, vertices: NDArray[np.float32]) -> float:
    """CPU milliseconds for scoring 1000 points, the median of three calls; NaN without any point."""
    if len(vertices) == 0:
        return float("nan")
    points = np.resize(vertices, (TIMED_POINTS, 3))
    times_s = []
    for _ in range(_TIMED_CALLS):
        start_s = time.process_time()
        neural_map.variability(points)
        times_s.append(time.process_time() - start_s)
    return 1000.0 * statistics.median(times_s)
