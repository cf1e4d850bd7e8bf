"""Conservative rasterisation: every cell that a triangle touches within a slab of heights.

Triangles are clipped to the slab and projected on the floor; a cell counts as soon as the projection
overlaps it, so that a wall thinner than a cell still blocks. Rays cast downwards would not do: one
that starts inside a wall sees only the floor.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anm_gym.sim.grid import GridFrame

BLOCK_TRIANGLES = 100_000
"""Triangles that are clipped at once; bounds the memory of large meshes."""
CHUNK_PAIRS = 1_000_000
"""Pairs of polygon and cell that are tested at once."""
TOUCH_CELLS = 1e-9
"""Gap, in cells times the edge's length, under which a polygon still touches a cell."""


def rasterise_slab(
    triangles: NDArray[np.float64], frame: GridFrame, low_y_m: float, high_y_m: float
) -> NDArray[np.bool_]:
    """Mark the cells that triangles touch between two heights.

    Args:
        triangles: (F, 3, 3) float64 corners, metres, world frame.
        frame: The raster; what lies outside of it is left out.
        low_y_m: Lower end of the slab, metres.
        high_y_m: Upper end of the slab, metres.

    Returns:
        (rows, columns) bool; the same for every tessellation of the same surface.

    Raises:
        ValueError: If the slab is upside down.

    Source:
        Ours: clipping against two planes, then separating axes in the floor plane.
    """
    if low_y_m > high_y_m:
        raise ValueError(f"`low_y_m` must be <= `high_y_m`, got {low_y_m} and {high_y_m}")
    marked = np.zeros(frame.shape, bool)
    bottom, top = triangles[..., 1].min(axis=1), triangles[..., 1].max(axis=1)
    is_inside = (bottom >= low_y_m) & (top <= high_y_m)
    is_cut = ~is_inside & (bottom <= high_y_m) & (top >= low_y_m)
    for block in _blocks(triangles, is_inside):
        _mark_polygons(marked, frame, block)
    for block in _blocks(triangles, is_cut):
        _mark_polygons(marked, frame, _clip(_clip(block, low_y_m, 1.0), high_y_m, -1.0))
    return marked


def _blocks(triangles: NDArray[np.float64], chosen: NDArray[np.bool_]) -> Iterator[NDArray[np.float64]]:
    index = np.flatnonzero(chosen)
    for start in range(0, len(index), BLOCK_TRIANGLES):
        yield triangles[index[start : start + BLOCK_TRIANGLES]]


def _clip(polygons: NDArray[np.float64], height_m: float, side: float) -> NDArray[np.float64]:
    """Keep the part of convex polygons (N, K, 3) with side * (y - height) >= 0, as (N, 2 K, 3).

    Each corner yields itself if it is inside, and each edge its crossing; a place without a point
    repeats the one before it on the ring. Polygons wholly outside become NaN.
    """
    above = side * (polygons[..., 1] - height_m)
    following, next_above = np.roll(polygons, -1, axis=1), np.roll(above, -1, axis=1)
    inside = above >= 0.0
    crosses = inside != (next_above >= 0.0)
    share = np.divide(above, above - next_above, out=np.zeros_like(above), where=crosses)
    crossing = polygons + share[..., None] * (following - polygons)
    points = _interleave(polygons, crossing)
    valid = _interleave(inside, crosses)
    before = np.maximum.accumulate(np.where(valid, np.arange(valid.shape[1]), -1), axis=1)
    last = valid.shape[1] - 1 - valid[:, ::-1].argmax(axis=1)
    source = np.where(before < 0, last[:, None], before)
    clipped = np.take_along_axis(points, source[..., None], axis=1)
    clipped[~valid.any(axis=1)] = np.nan
    return clipped


def _interleave(corners: NDArray[Any], edges: NDArray[Any]) -> NDArray[Any]:
    """Put each edge's value behind its corner's: (N, K, ...) twice to (N, 2 K, ...)."""
    stacked = np.stack([corners, edges], axis=2)
    return stacked.reshape(len(corners), -1, *corners.shape[2:])


def _mark_polygons(marked: NDArray[np.bool_], frame: GridFrame, polygons: NDArray[np.float64]) -> None:
    """Mark the cells under convex polygons (N, K, 3)."""
    flat = (polygons[..., [0, 2]] - frame.origin_xz) / frame.cell_m
    flat = flat[~np.isnan(flat[:, 0, 0])]
    low = np.maximum(np.floor(flat.min(axis=1)), 0.0).astype(np.int64)
    high = np.minimum(np.floor(flat.max(axis=1)), np.array(marked.shape[::-1]) - 1.0).astype(np.int64)
    spans = np.maximum(high - low + 1, 0)
    counts = spans.prod(axis=1)
    is_single = counts == 1
    marked[low[is_single, 1], low[is_single, 0]] = True
    flat, low, spans, counts = (values[counts > 1] for values in (flat, low, spans, counts))
    for start, stop in _chunks(counts):
        _mark_overlaps(marked, flat[start:stop], low[start:stop], spans[start:stop])


def _chunks(counts: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Split polygons into runs of about `CHUNK_PAIRS` candidate cells."""
    if len(counts) == 0:
        return []
    group = (np.cumsum(counts) - 1) // CHUNK_PAIRS
    edges = (np.flatnonzero(np.diff(group)) + 1).tolist()
    return list(zip([0, *edges], [*edges, len(counts)], strict=True))


def _mark_overlaps(
    marked: NDArray[np.bool_], polygons: NDArray[np.float64], low: NDArray[np.int64], spans: NDArray[np.int64]
) -> None:
    """Test each polygon (N, K, 2), in cells, against the cells of its bounding box.

    A polygon and a cell are apart only if an edge's normal separates them, or an axis of the raster,
    which the bounding box has settled.
    """
    counts = spans.prod(axis=1)
    polygon = np.repeat(np.arange(len(counts)), counts)
    order = np.arange(len(polygon)) - np.repeat(np.cumsum(counts) - counts, counts)
    cells = low[polygon] + np.stack([order % spans[polygon, 0], order // spans[polygon, 0]], axis=1)
    centers = cells + 0.5
    overlaps = np.ones(len(polygon), bool)
    for start, end in zip(
        np.moveaxis(polygons, 1, 0), np.roll(np.moveaxis(polygons, 1, 0), -1, 0), strict=True
    ):
        normal = np.stack([end[:, 1] - start[:, 1], start[:, 0] - end[:, 0]], axis=1)
        extent = np.einsum("nkd,nd->nk", polygons, normal)
        reach = 0.5 * np.abs(normal).sum(axis=1) + TOUCH_CELLS
        center = np.einsum("nd,nd->n", centers, normal[polygon])
        overlaps &= center >= (extent.min(axis=1) - reach)[polygon]
        overlaps &= center <= (extent.max(axis=1) + reach)[polygon]
    marked[cells[overlaps, 1], cells[overlaps, 0]] = True
