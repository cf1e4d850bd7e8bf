from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from anm_gym.map.occupancy import OccupancyGrid, clearance_of
from anm_gym.map.voronoi_graph import VoronoiGraph, VoronoiSettings, voronoi_graph
from anm_gym.sim.grid import GridFrame

CELL_M = 0.05
ENDS_ALONE = VoronoiSettings(spacing_m=float("inf"))
Painted = Callable[[NDArray[np.int8]], OccupancyGrid]


class PaintedGrid(OccupancyGrid):
    """A grid whose labels are given: 1 free, 0 unknown, -1 occupied."""

    def __init__(self, labels: NDArray[np.int8]) -> None:
        super().__init__(floor_y_m=0.0)
        self._frame = GridFrame((0.0, 0.0), CELL_M, (labels.shape[0], labels.shape[1]))
        self._hits, self._passes = (labels < 0).astype(np.int32), (labels > 0).astype(np.int32)
        self._assumed = self._stood = self._touched = np.zeros(labels.shape, bool)
        self._clearance_m = clearance_of(labels < 0, CELL_M)


def walls(rows: int, columns: int) -> NDArray[np.int8]:
    return np.full((rows, columns), -1, np.int8)


def graph_of(labels: NDArray[np.int8], settings: VoronoiSettings | None = None) -> VoronoiGraph:
    row, column = np.argwhere(labels == 1).mean(axis=0)
    graph = voronoi_graph(PaintedGrid(labels), ((column + 0.5) * CELL_M, (row + 0.5) * CELL_M), settings)
    assert graph is not None
    return graph


def corridor() -> NDArray[np.int8]:
    """6 m along x, 1.05 m wide, its middle at z = 0.575 m."""
    labels = walls(24, 124)
    labels[1:22, 2:122] = 1
    return labels


def test_way_through_a_corridor_is_its_middle_line() -> None:
    graph = graph_of(corridor(), VoronoiSettings(spur_m=1.0))
    inner = graph.frame.centers_of(graph.cells)
    inner = inner[np.abs(inner[:, 0] - 3.1) < 2.0]
    assert inner[:, 1] == pytest.approx(np.full(len(inner), 0.575), abs=0.06)


def test_no_cell_of_a_way_is_farther_from_a_vertex_than_the_spacing() -> None:
    graph = graph_of(corridor(), VoronoiSettings(spacing_m=0.8))
    cells = graph.frame.centers_of(graph.cells)
    gaps = np.linalg.norm(cells[:, None] - graph.positions_xz[None], axis=2).min(axis=1)
    assert gaps.max() <= 0.8
    assert len(graph_of(corridor(), ENDS_ALONE).vertices) < len(graph.vertices) < 12


def test_crossing_is_a_vertex() -> None:
    labels = walls(124, 124)
    labels[52:73, 2:122] = labels[2:122, 52:73] = 1
    vertices = graph_of(labels, ENDS_ALONE).positions_xz
    assert np.linalg.norm(vertices - 62.5 * CELL_M, axis=1).min() < 0.15


def test_distance_is_the_length_of_the_way() -> None:
    graph = graph_of(corridor())
    ends = graph.positions_xz[:, 0]
    lengths = graph.distances_from((1.0, 0.575))
    far = ends > 1.5
    assert lengths[far] == pytest.approx(ends[far] - 1.0, abs=0.35)


def test_short_dead_ends_are_cut() -> None:
    labels = corridor()
    labels[21:23, 60:68] = 1  # a notch in the wall
    plain, notched = (len(graph_of(each, ENDS_ALONE).vertices) for each in (corridor(), labels))
    assert notched == plain


def test_unknown_specks_do_not_split_the_way() -> None:
    speckled, holed = corridor(), corridor()
    speckled[10:12, 60:62] = 0
    holed[8:15, 56:66] = 0
    count = len(graph_of(corridor()).cells)
    assert len(graph_of(speckled).cells) == pytest.approx(count, abs=4)
    assert len(graph_of(holed, VoronoiSettings(speck_m2=0.01)).cells) > count + 8


def test_room_next_door_without_a_door_is_no_part_of_the_graph() -> None:
    labels = walls(44, 124)
    labels[2:20, 2:122] = 1
    labels[24:42, 2:122] = 1
    graph = voronoi_graph(PaintedGrid(labels), (3.0, 0.5))
    assert graph is not None
    assert graph.positions_xz[:, 1].max() < 1.1


def test_there_is_no_graph_where_the_agent_cannot_stand() -> None:
    assert voronoi_graph(PaintedGrid(walls(30, 30)), (0.7, 0.7)) is None
