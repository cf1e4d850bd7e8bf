from collections.abc import Iterator

import numpy as np
import pytest

from anm_gym.sim import grid_planning
from anm_gym.sim.geodesic import GridGraph
from anm_gym.sim.grid_planning import (
    PathTree,
    RrtSettings,
    _steps_from,
    astar_path,
    grow_tree,
    line_is_free,
    marching_distance,
)

QUICK = RrtSettings(iterations=400)


@pytest.fixture
def walled() -> np.ndarray:
    """Give 60 x 60 free cells with a wall across the middle that has a gap at the right."""
    free = np.ones((60, 60), bool)
    free[30, :55] = False
    return free


def test_path_by_astar_is_as_short_as_the_graph_s(rng: np.random.Generator) -> None:
    for _ in range(8):
        free = rng.random((25, 30)) > 0.35
        free[2, 3] = True
        distance = GridGraph(free, 1.0).distance_from([(2, 3)])
        for goal in rng.integers((25, 30), size=(6, 2)):
            path = astar_path(free, (2, 3), goal)
            assert (path is None) == np.isinf(distance[tuple(goal)])
            if path is not None:
                assert path[0].tolist() == [2, 3]
                assert path[-1].tolist() == goal.tolist()
                assert free[path[:, 0], path[:, 1]].all()
                length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
                assert length == pytest.approx(distance[tuple(goal)])


def test_path_by_astar_cuts_no_corner() -> None:
    free = np.ones((2, 2), bool)
    assert astar_path(free, (0, 0), (1, 1)).tolist() == [[0, 0], [1, 1]]
    free[0, 1] = False
    assert astar_path(free, (0, 0), (1, 1)).tolist() == [[0, 0], [1, 0], [1, 1]]
    free[1, 0] = False
    assert astar_path(free, (0, 0), (1, 1)) is None


def test_astar_looks_towards_the_goal_first(monkeypatch: pytest.MonkeyPatch) -> None:
    looked_at = []

    def counted(free: np.ndarray, cell: tuple[int, int]) -> Iterator[tuple[tuple[int, int], float]]:
        looked_at.append(cell)
        return _steps_from(free, cell)

    monkeypatch.setattr(grid_planning, "_steps_from", counted)
    path = astar_path(np.ones((60, 60), bool), (30, 30), (30, 50))
    assert path is not None
    assert len(path) == 21
    assert len(looked_at) == 20


def test_astar_finds_no_path_through_a_wall_or_outside(walled: np.ndarray) -> None:
    assert astar_path(walled, (10, 10), (90, 10)) is None
    assert astar_path(walled, (-1, 10), (10, 10)) is None
    assert astar_path(walled, (30, 10), (10, 10)) is None
    walled[30] = False
    assert astar_path(walled, (10, 10), (50, 10)) is None


def test_marching_distance_is_nearly_straight_in_the_open() -> None:
    distance = marching_distance(np.ones((81, 81), bool), 0.1, [(40, 40)])
    rows, columns = np.ogrid[:81, :81]
    straight = 0.1 * np.hypot(rows - 40, columns - 40)
    graph = GridGraph(np.ones((81, 81), bool), 0.1).distance_from([(40, 40)])
    far = straight > 0.5
    assert (distance[far] >= straight[far] - 1e-9).all()
    assert (distance[far] / straight[far]).max() < 1.04 < (graph[far] / straight[far]).max()


def test_marching_distance_is_as_straight_across_a_large_raster() -> None:
    distance = marching_distance(np.ones((300, 300), bool), 1.0, [(0, 0)])
    straight = np.hypot(*np.indices((300, 300)))
    assert (distance / np.maximum(straight, 1.0))[straight > 5.0].max() < 1.04


def test_marching_distance_goes_round_walls(walled: np.ndarray) -> None:
    distance = marching_distance(walled, 0.1, [(10, 10)])
    around = 0.1 * (np.hypot(20, 45) + np.hypot(20, 45))
    assert distance[50, 10] == pytest.approx(around, rel=0.05)
    assert np.isinf(distance[30, 10])
    walled[30] = False
    assert np.isinf(marching_distance(walled, 0.1, [(10, 10)])[50, 10])


def test_line_stops_at_a_blocked_cell() -> None:
    blocked = np.zeros((20, 20), bool)
    blocked[10, 10] = True
    starts = np.array([[5.5, 10.5], [5.5, 2.5], [10.5, 5.5]])
    assert line_is_free(blocked, starts, np.array([15.5, 10.5])).tolist() == [False, True, True]


def test_no_edge_of_a_tree_crosses_a_wall(walled: np.ndarray, rng: np.random.Generator) -> None:
    tree = grow_tree(~walled, 0.1, (20.5, 50.5), QUICK, rng)
    ends = tree.nodes[tree.parents]
    for node, before in zip(tree.nodes, ends, strict=True):
        assert line_is_free(~walled, before[None], node)[0]
    assert (tree.nodes[:, 0] > 31.0).any()


def test_edges_are_no_longer_than_the_extension(rng: np.random.Generator) -> None:
    tree = grow_tree(np.zeros((80, 80), bool), 0.05, (40.5, 40.5), QUICK, rng)
    edges = np.linalg.norm(tree.nodes - tree.nodes[tree.parents], axis=1)
    assert edges.max() <= 5.0 + 1e-9


def test_rewiring_shortens_ways(rng: np.random.Generator) -> None:
    blocked, start = np.zeros((80, 80), bool), np.array([40.5, 40.5])
    lone = RrtSettings(iterations=1500, neighbour_m=1e-6)
    stretch = []
    for settings in (lone, RrtSettings(iterations=1500, neighbour_m=1.0)):
        tree = grow_tree(blocked, 0.1, start, settings, np.random.default_rng(3))
        lengths = [
            np.linalg.norm(np.diff(tree.path_to(n), axis=0), axis=1).sum() for n in range(len(tree.nodes))
        ]
        straight = np.linalg.norm(tree.nodes - start, axis=1)
        stretch.append(np.sum(lengths) / straight.sum())
    assert 1.0 <= stretch[1] < stretch[0] - 0.03


def test_window_leaves_far_cells_alone(rng: np.random.Generator) -> None:
    blocked = np.zeros((400, 400), bool)
    near = grow_tree(blocked, 0.1, (200.5, 200.5), RrtSettings(iterations=300, window_m=3.0), rng)
    assert np.abs(near.nodes - 200.5).max() <= 30.0
    whole = grow_tree(blocked, 0.1, (200.5, 200.5), RrtSettings(iterations=300, sampling="whole_map"), rng)
    assert np.abs(whole.nodes - 200.5).max() > 30.0


def test_tree_repeats_under_a_seed(walled: np.ndarray) -> None:
    trees = [grow_tree(~walled, 0.1, (20.5, 20.5), QUICK, np.random.default_rng(5)) for _ in range(2)]
    assert (trees[0].nodes == trees[1].nodes).all()
    assert (trees[0].parents == trees[1].parents).all()


def test_tree_of_a_walled_in_start_stays_in_its_cell(rng: np.random.Generator) -> None:
    blocked = np.ones((20, 20), bool)
    tree = grow_tree(blocked, 0.1, (10.5, 10.5), QUICK, rng)
    assert (tree.nodes.astype(int) == 10).all()


def test_depth_counts_edges_from_the_start() -> None:
    tree = PathTree(np.arange(10.0).reshape(5, 2), np.array([0, 0, 1, 2, 1]))
    assert tree.depths.tolist() == [0, 1, 2, 3, 2]
    assert tree.path_to(3) == pytest.approx(tree.nodes[:4])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"iterations": 0}, "`iterations` must be >= 1, got 0"),
        ({"window_m": 0.0}, "`window_m` must be > 0, got 0.0"),
    ],
)
def test_senseless_settings_are_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        RrtSettings(**options)
