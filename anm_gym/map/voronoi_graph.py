"""The generalised Voronoi graph of the known floor: ways far from obstacles, and where they meet."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from skimage.morphology import skeletonize

from anm_gym.checks import check_at_least, check_positive
from anm_gym.map.occupancy import OccupancyGrid
from anm_gym.map.reach import ESCAPE_M
from anm_gym.sim.geodesic import STEPS, nearest_free_cell
from anm_gym.sim.grid import GridFrame

EIGHT: Final = np.ones((3, 3), bool)


@dataclass(frozen=True)
class VoronoiSettings:
    """What the graph keeps (ours)."""

    radius_m: float = 0.15
    """Clearance that its ways keep from known obstacles, metres."""
    speck_m2: float = 0.1
    """Unknown specks up to this size inside free floor are taken as free, square metres."""
    spur_m: float = 0.4
    """Dead ends shorter than this are cut, metres."""
    junction_gap_m: float = 0.3
    """Junctions and dead ends closer than this to another are dropped, metres."""
    spacing_m: float = 1.0
    """No cell of a way is farther than this from a vertex, metres; infinite keeps junctions and dead ends."""

    def __post_init__(self) -> None:
        check_positive(self, "radius_m", "spacing_m")
        check_at_least(self, 0.0, "speck_m2", "spur_m", "junction_gap_m")


@dataclass(frozen=True, eq=False)
class VoronoiGraph:
    """The ways, cell by cell, and the vertices on them."""

    frame: GridFrame
    """Where the cells lie."""
    cells: NDArray[np.int64]
    """(K, 2) cells [row, column] on the ways."""
    vertices: NDArray[np.int64]
    """(V,) indices of the cells that are vertices."""
    lengths_m: csr_array
    """(K, K) sparse lengths between neighbouring cells, metres, in one direction."""

    @property
    def positions_xz(self) -> NDArray[np.float64]:
        """(V, 2) floor points of the vertices, metres."""
        return self.frame.centers_of(self.cells[self.vertices]).reshape(-1, 2)

    def distances_from(self, position_xz: ArrayLike) -> NDArray[np.float64]:
        """Length (V,) of the way from a floor point to the graph and along it to each vertex, metres."""
        gaps = np.linalg.norm(self.frame.centers_of(self.cells) - np.asarray(position_xz), axis=1)
        nearest = int(gaps.argmin())
        along = dijkstra(self.lengths_m, directed=False, indices=nearest)
        return np.asarray(gaps[nearest] + along[self.vertices], np.float64)


def voronoi_graph(
    occupancy: OccupancyGrid, position_xz: ArrayLike, settings: VoronoiSettings | None = None
) -> VoronoiGraph | None:
    """Thin the free floor around the agent to its Voronoi graph.

    Args:
        occupancy: What is known of the floor.
        position_xz: (2,) where the agent stands, metres; only the part that it can reach counts.
        settings: Clearance and what is left out.

    Returns:
        The graph, with at least one vertex; None if nothing near the agent is passable.

    Source:
        Active Neural Mapping at Scale, 2024: vertices of the generalised Voronoi graph; thinning the raster
        and vertices along long ways are ours.
    """
    settings = settings or VoronoiSettings()
    frame = occupancy.frame
    passable = _without_specks(occupancy, settings)
    start = nearest_free_cell(passable, frame.cells_of(position_xz)[0], round(ESCAPE_M / frame.cell_m))
    if start is None:
        return None
    labels, _ = ndimage.label(passable)
    ways = _cut_spurs(_thinned(labels == labels[start[0], start[1]]), settings.spur_m / frame.cell_m)
    cells, degrees = np.argwhere(ways), _degrees(ways)[ways]
    special = np.flatnonzero((degrees == 1) | (degrees >= 3))
    gap, spacing = settings.junction_gap_m / frame.cell_m, settings.spacing_m / frame.cell_m
    vertices = _spread(cells, special, np.empty(0, np.int64), gap)
    vertices = _spread(cells, np.arange(len(cells)), vertices, spacing)
    return VoronoiGraph(frame, cells, vertices, _lengths(ways, frame.cell_m))


def _without_specks(occupancy: OccupancyGrid, settings: VoronoiSettings) -> NDArray[np.bool_]:
    """Passable cells, and small unknown specks between them."""
    labels, count = ndimage.label(occupancy.unknown)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    small = sizes <= settings.speck_m2 / occupancy.cell_m**2
    small[0] = False
    clear = small[labels] & (occupancy.clearance_m > settings.radius_m)
    return np.asarray(occupancy.traversable(settings.radius_m) | clear)


def _thinned(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return np.asarray(skeletonize(mask))  # type: ignore[no-untyped-call]


def _degrees(ways: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Number of neighbours on the ways of each cell on them; 0 elsewhere."""
    neighbours = ndimage.convolve(ways.astype(np.int64), EIGHT.astype(np.int64), mode="constant") - 1
    return np.where(ways, neighbours, 0)


def _cut_spurs(ways: NDArray[np.bool_], length: float) -> NDArray[np.bool_]:
    """Drop chains of fewer cells than a length that lead from a junction to a dead end."""
    degrees = _degrees(ways)
    junctions = degrees >= 3
    labels, count = ndimage.label(ways & ~junctions, structure=EIGHT)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    has_end = np.zeros(count + 1, bool)
    has_end[np.unique(labels[degrees == 1])] = True
    meets_junction = np.zeros(count + 1, bool)
    meets_junction[np.unique(labels[ndimage.binary_dilation(junctions, EIGHT)])] = True
    is_spur = (sizes < length) & has_end & meets_junction
    is_spur[0] = False
    kept = ways & ~is_spur[labels]
    return _thinned(kept)


def _spread(
    cells: NDArray[np.int64], candidates: NDArray[np.int64], chosen: NDArray[np.int64], gap: float
) -> NDArray[np.int64]:
    """Add candidates to chosen cells, the farthest first, while they are farther than a gap from all."""
    if len(candidates) == 0:
        return chosen
    result = chosen.tolist()
    points = cells[candidates].astype(np.float64)
    distance = np.full(len(points), np.inf)
    for index in chosen:
        distance = np.minimum(distance, np.linalg.norm(points - cells[index], axis=1))
    while distance.max() > gap:
        farthest = int(distance.argmax())
        result.append(int(candidates[farthest]))
        distance = np.minimum(distance, np.linalg.norm(points - points[farthest], axis=1))
    return np.array(result, np.int64)


def _lengths(ways: NDArray[np.bool_], cell_m: float) -> csr_array:
    """Lengths between neighbouring cells of the ways."""
    count = int(ways.sum())
    index = np.full(ways.shape, -1)
    index[ways] = np.arange(count)
    parts = []
    for d_row, d_column in STEPS:
        left = slice(max(0, -d_column), ways.shape[1] - max(0, d_column))
        right = slice(max(0, d_column), ways.shape[1] - max(0, -d_column))
        first, second = index[: ways.shape[0] - d_row, left], index[d_row:, right]
        both = (first >= 0) & (second >= 0)
        parts.append((first[both], second[both], np.full(int(both.sum()), np.hypot(d_row, d_column))))
    rows, columns, lengths = (np.concatenate(values) for values in zip(*parts, strict=True))
    return csr_array((cell_m * lengths, (rows, columns)), shape=(count, count))
