"""Surface that is worth a look: predicted where nobody has seen any, or hoped for beyond free space.

What the map predicts behind a wall that was seen whole is nobody's to see, and there is far more of it than
of what can be seen. So predictions are followed from free space through space without hits alone, and blocks
of voxels keep their strongest state, lest the gaps between the hits on a wall be taken for openings.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from anm_gym.checks import check_at_least, check_share
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.volume import FREE, OCCUPIED, UNKNOWN, ObservedVolume
from anm_gym.map.zero_crossings import Lattice, zero_crossings_within


@dataclass(frozen=True)
class SurfaceSettings:
    """Which surface is worth looking at (ours)."""

    block_voxels: int = 2
    """Voxels along the edge of the blocks between whose centres zero-crossings are extracted."""
    margin_m: float = 1.0
    """How far into unknown space they are followed, metres."""
    seen_m: float = 0.15
    """Surface this close to an observed point is taken as seen, metres."""
    frontier_share: float = 1.0
    """Worth of a point on the rim of observed free space, where surface may begin, relative to one of
    predicted surface; 0 looks at predicted surface alone."""
    frontier_gap_m: float = 0.3
    """Points of the rim nearer to observed surface are left out, metres."""
    only_unseen: bool = True
    """Drop surface that is taken as seen, floats in observed free space or lies behind what was seen; False
    trusts variability alone."""
    doubt_visibility: float = 0.9
    """Surface that the present image should show with this likelihood, but does not, is doubted."""
    doubt_m: float = 0.15
    """Surface this close to doubted surface is not looked for again, metres."""
    reference_quantile: float = 0.9
    """Variability of observed surface at this quantile weighs one half."""
    reference_points: int = 512
    """Observed points, at least, from which that quantile is taken; fewer than twice as many."""

    def __post_init__(self) -> None:
        check_at_least(self, 1, "block_voxels", "reference_points")
        check_at_least(self, 0.0, "margin_m", "seen_m", "frontier_share", "frontier_gap_m", "doubt_m")
        check_share(self, "reference_quantile")


@dataclass(frozen=True)
class VariableSurface:
    """Points that are worth a look, and how much."""

    points: NDArray[np.float32]
    """(V, 3) float32, metres, world frame."""
    weights: NDArray[np.float32]
    """(V,) float32, not negative."""


def worthwhile_points(neural_map: NeuralMap, settings: SurfaceSettings) -> VariableSurface:
    """Collect predicted surface that nobody has seen, and the rim of observed free space.

    Args:
        neural_map: A map that has seen at least one frame.
        settings: Lattice, margin and what counts as seen.

    Returns:
        The points, weighed by kind alone; empty if there are none.

    Source:
        Active Neural Mapping, Sec. 4.2 (zero-crossings); what is left out, and the rim, are ours.
    """
    if len(neural_map.cloud) == 0:
        return VariableSurface(np.empty((0, 3), np.float32), np.zeros(0, np.float32))
    margin = settings.margin_m * np.array([1.0, 0.0, 1.0])
    bounds = neural_map.cloud.bounds(0.001) + np.stack([-margin, margin])
    lattice, states = _blocks(neural_map.volume, bounds, settings.block_voxels)
    surface = _predicted_surface(neural_map, lattice, states, settings)
    rim = np.empty((0, 3), np.float32)
    if settings.frontier_share > 0.0:
        rim = lattice.points_in((states == UNKNOWN) & ndimage.binary_dilation(states == FREE))
        rim = rim[~neural_map.cloud.is_near(rim, settings.frontier_gap_m)]
    shares = np.repeat([1.0, settings.frontier_share], [len(surface), len(rim)])
    return VariableSurface(np.concatenate([surface, rim]), shares.astype(np.float32))


def _predicted_surface(
    neural_map: NeuralMap, lattice: Lattice, states: NDArray[np.uint8], settings: SurfaceSettings
) -> NDArray[np.float32]:
    """(V, 3) zero-crossings that unknown space joins to free space."""
    reach = round(settings.margin_m / lattice.spacing_m[0])
    passable = states != OCCUPIED if settings.only_unseen else None
    nearby = states == FREE
    if reach > 0:  # no iterations would mean any number of them
        nearby = ndimage.binary_dilation(nearby, iterations=reach, mask=passable)
    asked = nearby & ~ndimage.binary_erosion(states == FREE)
    vertices = zero_crossings_within(neural_map.sdf, lattice, asked).vertices
    if settings.only_unseen and len(vertices):
        vertices = vertices[neural_map.volume.state_at(vertices) == UNKNOWN]
        vertices = vertices[~neural_map.cloud.is_near(vertices, settings.seen_m)]
    return vertices


def _blocks(
    volume: ObservedVolume, bounds: NDArray[np.float64], edge: int
) -> tuple[Lattice, NDArray[np.uint8]]:
    """Pool voxels to blocks that cover (2, 3) bounds and one block more above and below.

    Returns:
        The centres of the blocks, and the strongest state in each, (X, Y, Z).
    """
    spacing_m = edge * volume.voxel_m
    above = np.array([0, 1, 0])
    low = np.floor(bounds[0] / spacing_m).astype(np.int64) - above
    high = np.ceil(bounds[1] / spacing_m).astype(np.int64) + above
    x, y, z = (high - low).tolist()
    voxels = volume.window(low * edge, high * edge)
    states = voxels.reshape(x, edge, y, edge, z, edge).max(axis=(1, 3, 5))
    return Lattice((low + 0.5) * spacing_m, np.full(3, spacing_m), (x, y, z)), states


def weigh_by_variability(
    neural_map: NeuralMap, surface: VariableSurface, settings: SurfaceSettings
) -> VariableSurface:
    """Weigh points by their neural variability, relative to that of observed surface (ours)."""
    observed = neural_map.cloud.points
    stride = max(1, len(observed) // settings.reference_points)
    scores = neural_map.variability(np.concatenate([surface.points, observed[::stride]]))
    reference = float(np.quantile(scores[len(surface.points) :], settings.reference_quantile))
    variability = scores[: len(surface.points)]
    return VariableSurface(
        surface.points, surface.weights * variability / (variability + np.float32(max(reference, 1e-12)))
    )
