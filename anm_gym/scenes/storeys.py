"""Storeys of a mesh: flat heights on which a body fits, indoors.

A flat height is only a candidate: table tops, ceilings and roofs are flat too. A candidate becomes a
storey if the traversable grid finds room for the body on it and rays find walls or a ceiling around.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from anm_gym.mesh import TriangleMesh
from anm_gym.scenes.probes import EYE_HEIGHT_M, Surroundings, make_probe, probe_surroundings
from anm_gym.scenes.scene import Storey
from anm_gym.sim.camera import DepthCamera
from anm_gym.sim.indoors import INDOORS_M2
from anm_gym.sim.traversable import TraversableGrid

MIN_STOREY_GAP_M: Final = 1.8
"""Floors closer than this belong to one storey, metres: a person's height (ours)."""
MIN_AREA_M2: Final = 0.5
"""Least navigable area of a storey, square metres (ours)."""
MIN_SHARE_OF_LARGEST: Final = 0.1
"""Least navigable area of a storey as a share of the largest storey's (ours)."""

_BIN_M: Final = 0.02
_WINDOW_BINS: Final = 5
_PEAK_GAP_M: Final = 0.08
_THICKEST_SLAB_M: Final = 0.5
_MAX_CANDIDATES: Final = 16
_MAX_LEAST_M2: Final = 2.0
"""Level surface that is always looked at, square metres: beside a landscape any floor is small."""
_MIN_LEVELNESS: Final = 0.9
_TILTED_M: Final = 0.5


@dataclass(frozen=True)
class _Candidate:
    floor_y_m: float
    area_m2: float
    surroundings: Surroundings


def find_storeys(mesh: TriangleMesh) -> tuple[Storey, ...]:
    """Find every level on which the default body can move about.

    Args:
        mesh: Mesh in metres, y up.

    Returns:
        Storeys from the lowest up; empty if the body fits nowhere.

    Source:
        Ours. Winding is not trusted: a face counts as level by |normal.y| >= 0.9.
    """
    heights_m, areas_m2 = level_heights(mesh)
    if len(heights_m) == 0:
        return ()
    candidates = _navigable(mesh, heights_m, areas_m2)
    indoors = [candidate for candidate in candidates if candidate.surroundings.is_sheltered]
    outdoors = [found for found in candidates if not _is_roof(found, heights_m, areas_m2)]
    kept = _merge_close(indoors or outdoors)
    largest_m2 = max((candidate.area_m2 for candidate in kept), default=0.0)
    large = [candidate for candidate in kept if candidate.area_m2 >= MIN_SHARE_OF_LARGEST * largest_m2]
    return tuple(
        Storey(index, found.floor_y_m, found.surroundings.ceiling_y_m, found.area_m2)
        for index, found in enumerate(sorted(large, key=lambda found: found.floor_y_m))
    )


def level_heights(mesh: TriangleMesh) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find the heights at which a mesh has much level surface.

    Args:
        mesh: Mesh in metres, y up.

    Returns:
        (K,) heights, metres, by falling area, and (K,) level area within 5 cm of each, square metres.
    """
    is_level = np.abs(mesh.normals[:, 1]) >= _MIN_LEVELNESS
    if not is_level.any():
        return np.zeros(0), np.zeros(0)
    heights_m = mesh.triangles[is_level, :, 1].mean(axis=1)
    areas_m2 = mesh.areas_m2[is_level]
    peaks = list(_peaks(heights_m, areas_m2))
    return np.array([height for height, _ in peaks]), np.array([area for _, area in peaks])


def floor_tilt_deg(mesh: TriangleMesh, floor_y_m: float) -> float:
    """Measure how far a floor is from level, degrees: the median slope of nearly level faces around it.

    Args:
        mesh: Mesh in metres, y up.
        floor_y_m: Height of the floor; faces within `_TILTED_M` of it count, whatever stands there.

    Source:
        Ours. The noise of scans cancels out, and a few ramps do not count.
    """
    heights_m = mesh.triangles[:, :, 1].mean(axis=1)
    is_floor = (np.abs(heights_m - floor_y_m) < _TILTED_M) & (np.abs(mesh.normals[:, 1]) >= _MIN_LEVELNESS)
    if not is_floor.any():
        return 0.0
    normals, areas_m2 = mesh.normals[is_floor], mesh.areas_m2[is_floor]
    along_x, along_z = (_weighted_median(normals[:, axis] / normals[:, 1], areas_m2) for axis in (0, 2))
    return float(np.rad2deg(np.arctan(np.hypot(along_x, along_z))))


def _peaks(heights_m: NDArray[np.float64], areas_m2: NDArray[np.float64]) -> Iterator[tuple[float, float]]:
    """Yield (height, area) of the histogram's peaks, largest first, each removed before the next."""
    lowest_m = float(heights_m.min()) - _WINDOW_BINS * _BIN_M
    bins = np.floor((heights_m - lowest_m) / _BIN_M).astype(np.int64)
    histogram = np.bincount(bins, areas_m2, int(bins.max()) + _WINDOW_BINS)
    smooth = np.convolve(histogram, np.ones(_WINDOW_BINS), mode="same")
    centers_m = lowest_m + (np.arange(len(smooth)) + 0.5) * _BIN_M
    least_m2 = min(max(MIN_AREA_M2, 0.02 * float(smooth.max())), _MAX_LEAST_M2)
    for _ in range(_MAX_CANDIDATES):
        peak = int(smooth.argmax())
        if smooth[peak] < least_m2:
            return
        is_near = np.abs(bins - peak) <= _WINDOW_BINS // 2
        height_m = round(_weighted_median(heights_m[is_near], areas_m2[is_near]), 3) + 0.0
        yield height_m, float(smooth[peak])
        smooth[np.abs(centers_m - height_m) <= _PEAK_GAP_M] = 0.0


def _weighted_median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    order = np.argsort(values, kind="stable")
    cumulative = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(cumulative, 0.5 * cumulative[-1])])


def _navigable(
    mesh: TriangleMesh, heights_m: NDArray[np.float64], areas_m2: NDArray[np.float64]
) -> list[_Candidate]:
    """Keep the heights on which the body fits, with the area and surroundings of each."""
    caster = make_probe(mesh)
    highest_m = float(mesh.bounds[1, 1]) - EYE_HEIGHT_M
    found: list[_Candidate] = []
    ranked = zip(heights_m.tolist(), areas_m2.tolist(), strict=True)
    for height_m, area_m2 in sorted(ranked, key=lambda peak: (peak[0] > highest_m, -peak[1])):
        if not _is_hopeless(height_m, area_m2, found, is_roof=height_m > highest_m):
            found.extend(_try_height(mesh, caster, height_m))
    return found


def _try_height(mesh: TriangleMesh, caster: DepthCamera, height_m: float) -> list[_Candidate]:
    grid = TraversableGrid.from_mesh(mesh, height_m)
    area_m2 = next(iter(grid.component_areas_m2), 0.0)
    if area_m2 < MIN_AREA_M2:
        return []
    return [_Candidate(height_m, area_m2, probe_surroundings(caster, mesh, grid, height_m))]


def _is_hopeless(height_m: float, area_m2: float, found: Sequence[_Candidate], is_roof: bool) -> bool:
    """Whether a height cannot win: a roof, or too little surface, against an indoor floor found before."""
    return any(
        is_roof or (abs(height_m - other.floor_y_m) < MIN_STOREY_GAP_M and area_m2 < 0.5 * other.area_m2)
        for other in found
        if other.surroundings.is_sheltered
    )


def _is_roof(found: _Candidate, heights_m: NDArray[np.float64], areas_m2: NDArray[np.float64]) -> bool:
    """Whether an open place lies over other large level surfaces, more than a slab's thickness below."""
    is_below = heights_m < found.floor_y_m - _THICKEST_SLAB_M
    return bool((areas_m2[is_below] >= 0.5 * found.area_m2).any())


def _merge_close(candidates: Sequence[_Candidate]) -> list[_Candidate]:
    """Keep the largest of each group of close floors; of nearly equal ones, the highest.

    A floor under a roof comes before open ground around the house, however large that is. Both faces of a
    thin slab hold the body, since it steps over 10 cm, but it stands on the upper.
    """
    kept: list[_Candidate] = []
    by_rank = sorted(candidates, key=lambda found: found.floor_y_m, reverse=True)
    while by_rank:
        largest = max(by_rank, key=lambda found: found.area_m2)
        roofed = [f for f in by_rank if f.surroundings.is_roofed and f.area_m2 >= INDOORS_M2]
        rivals = by_rank if largest.surroundings.is_walled else roofed or by_rank
        largest_m2 = max(found.area_m2 for found in rivals)
        best = next(found for found in rivals if found.area_m2 >= 0.9 * largest_m2)
        kept.append(best)
        by_rank = [f for f in by_rank if abs(f.floor_y_m - best.floor_y_m) >= MIN_STOREY_GAP_M]
    return kept
