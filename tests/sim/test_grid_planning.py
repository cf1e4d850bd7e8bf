import numpy as np
import pytest

from anm_gym.sim.geodesic import GridGraph
from anm_gym.sim.grid_planning import (
    PathTree,
    RrtSettings,
    grow_tree,
    line_is_free,
    marching_distance,
    windowed_path,
)

QUICK = RrtSettings(iterations=400)


@pytest.fixture
def walled() -> np.ndarray:
    """Give 60 x 60 free cells with a wall across the middle that has a gap at the right."""
    free = np.ones((60, 60), bool)
    free[30, :55] = False
    return free


def test_windowed_path_is_the_shortest(walled: np.ndarray) -> None:
    found = windowed_path(walled, 0.1, (10, 50), (50, 50), margin_m=1.0)
    assert found is not None
    whole = GridGraph(walled, 0.1).path((10, 50), (50, 50))
    assert whole is not None
    length = np.linalg.norm(np.diff(found, axis=0), axis=1).sum()
    assert length == pytest.approx(np.linalg.norm(np.diff(whole, axis=0), axis=1).sum())


def test_path_that_leaves_the_window_is_found_too(walled: np.ndarray) -> None:
    found = windowed_path(walled, 0.1, (25, 5), (35, 5), margin_m=0.5)
    assert found is not None
    assert found[:, 1].max() >= 55


def test_no_path_is_none(walled: np.ndarray) -> None:
    walled[30] = False
    assert windowed_path(walled, 0.1, (10, 10), (50, 10), margin_m=1.0) is None
    assert windowed_path(walled, 0.1, (10, 10), (50, 10), margin_m=99.0) is None
    assert windowed_path(walled, 0.1, (10, 10), (90, 10), margin_m=1.0) is None


def test_marching_distance_is_nearly_straight_in_the_open() -> None:
    distance = marching_distance(np.ones((81, 81), bool), 0.1, [(40, 40)])
    rows, columns = np.ogrid[:81, :81]
    straight = 0.1 * np.hypot(rows - 40, columns - 40)
    graph = GridGraph(np.ones((81, 81), bool), 0.1).distance_from([(40, 40)])
    far = straight > 0.5
    assert (distance[far] >= straight[far] - 1e-9).all()
    assert (distance[far] / straight[far]).max() < 1.04 < (graph[far] / straight[far]).max()


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


def test_walled_in_start_stays_alone(rng: np.random.Generator) -> None:
    blocked = np.ones((20, 20), bool)
    tree = grow_tree(blocked, 0.1, (10.5, 10.5), QUICK, rng)
    assert len(tree.nodes) >= 1
    assert (tree.nodes.astype(int) == 10).all()


def test_depth_counts_edges_from_the_start() -> None:
    tree = PathTree(np.arange(10.0).reshape(5, 2), np.array([0, 0, 1, 2, 1]))
    assert tree.depths.tolist() == [0, 1, 2, 3, 2]
    assert tree.path_to(3) == pytest.approx(tree.nodes[:4])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"iterations": 0}, "`iterations` must be >= 1, got 0"),
        ({"window_m": 0.0}, "`extension_m`, `neighbour_m`, `shrink_m` and `window_m` must be > 0"),
    ],
)
def test_senseless_settings_are_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        RrtSettings(**options)
