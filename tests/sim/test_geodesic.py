import numpy as np
import pytest

from anm_gym.sim.geodesic import GridGraph, nearest_free_cell

CELL_M = 0.05
DIAGONAL = np.sqrt(2.0)


def parse(drawing: str):
    """Read a map: '#' blocks, all else is free."""
    return np.array([[letter != "#" for letter in line] for line in drawing.split()])


def test_a_corridor_is_as_long_as_its_cells():
    distance = GridGraph(np.ones((1, 101), bool), CELL_M).distance_from((0, 0))
    np.testing.assert_allclose(distance[0], np.arange(101) * CELL_M, atol=1e-12)


def test_an_open_floor_measures_the_octile_distance(rng):
    free = np.ones((20, 30), bool)
    distance = GridGraph(free, CELL_M).distance_from((5, 7))
    rows, columns = np.abs(np.indices(free.shape) - np.array([5, 7])[:, None, None])
    short, long = np.minimum(rows, columns), np.maximum(rows, columns)
    np.testing.assert_allclose(distance, CELL_M * (long - short + DIAGONAL * short), atol=1e-9)


@pytest.mark.parametrize("drawing", [".# ..", ".. #.", "#. ..", ".. .#"])
def test_corners_are_not_cut(drawing):
    free = parse(drawing)
    start, goal = ((0, 0), (1, 1)) if free[0, 0] and free[1, 1] else ((0, 1), (1, 0))
    assert GridGraph(free, 1.0).distance_from(start)[goal] == 2.0


def test_cells_that_touch_at_a_corner_are_not_connected():
    graph = GridGraph(parse(".# #."), CELL_M)
    assert graph.distance_from((0, 0))[1, 1] == np.inf
    assert graph.path((0, 0), (1, 1)) is None


def test_a_wall_is_walked_around():
    graph = GridGraph(parse("..... .###. ....."), 1.0)
    path = graph.path((0, 2), (2, 2))
    np.testing.assert_array_equal(path[[0, -1]], [[0, 2], [2, 2]])
    assert graph.distance_from((0, 2))[2, 2] == 6.0
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() == 6.0


def test_the_distance_is_symmetric_and_the_path_as_long(rng):
    free = rng.random((25, 25)) > 0.25
    graph = GridGraph(free, CELL_M)
    cells = np.argwhere(free)
    for start, goal in cells[rng.integers(len(cells), size=(20, 2))]:
        tree = graph.tree_from(start)
        assert tree.distance_m[tuple(goal)] == pytest.approx(graph.distance_from(goal)[tuple(start)])
        path = tree.path_to(goal)
        assert (path is None) == np.isinf(tree.distance_m[tuple(goal)])
        if path is not None:
            length_m = CELL_M * np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
            assert length_m == pytest.approx(tree.distance_m[tuple(goal)])
            assert free[path[:, 0], path[:, 1]].all()


def test_the_nearest_of_several_sources_counts():
    distance = GridGraph(np.ones((1, 11), bool), 1.0).distance_from([[0, 0], [0, 10]])
    assert distance[0].tolist() == [0, 1, 2, 3, 4, 5, 4, 3, 2, 1, 0]


def test_sources_in_walls_or_outside_reach_nothing():
    graph = GridGraph(parse("#.."), 1.0)
    assert np.isinf(graph.distance_from([[0, 0], [5, 5], [-1, 1]])).all()
    assert graph.path((0, 0), (0, 2)) is None
    assert graph.path((0, 1), (0, 7)) is None
    assert graph.path((0, 1), (0, 0)) is None


def test_the_path_to_the_start_is_the_start():
    assert GridGraph(parse("..."), 1.0).path((0, 1), (0, 1)).tolist() == [[0, 1]]


def test_costly_cells_are_avoided_and_weigh_half_on_each_side():
    free, cost = np.ones((3, 5), bool), np.ones((3, 5))
    cost[1, 2] = 9.0
    graph = GridGraph(free, 1.0, cost)
    assert [1, 2] not in graph.path((1, 0), (1, 4)).tolist()
    assert graph.distance_from((1, 1))[1, 2] == 5.0


def test_a_dear_corner_is_not_slipped_past():
    """Two dear cells touch at a corner: the diagonal between the cheap ones costs as they do."""
    free, cost = np.ones((2, 2), bool), np.array([[1.0, 9.0], [9.0, 1.0]])
    assert GridGraph(free, 1.0, cost).distance_from((0, 0))[1, 1] == pytest.approx(DIAGONAL)
    dear = GridGraph(free, 1.0, cost, has_dear_corners=True)
    assert dear.distance_from((0, 0))[1, 1] == pytest.approx(10.0), "round the corner, half of each step dear"
    free, cost = np.ones((2, 3), bool), np.array([[1.0, 1.0, 1.0], [1.0, 9.0, 1.0]])
    dear = GridGraph(free, 1.0, cost, has_dear_corners=True)
    assert dear.distance_from((0, 1))[1].tolist() == [2.0, 5.0, 2.0], "corners of one dear cell are dear too"


def test_a_wave_goes_on_from_where_it_is(rng):
    free = rng.random((20, 30)) > 0.2
    graph, cells = GridGraph(free, CELL_M, 1.0 + rng.random(free.shape)), np.argwhere(free)
    begins = cells[rng.choice(len(cells), 5, replace=False)]
    beginning_m = np.full(free.shape, np.inf)
    beginning_m[tuple(begins.T)] = start_m = np.array([0.0, 0.1, 0.2, 0.4, 5.0])
    expected = np.min(
        [at_m + graph.distance_from(cell) for cell, at_m in zip(begins, start_m, strict=True)], axis=0
    )
    np.testing.assert_allclose(graph.spread(beginning_m), expected)


def test_a_wave_begins_on_free_cells_only():
    graph = GridGraph(parse("#.#."), 1.0)
    np.testing.assert_array_equal(
        graph.spread(np.array([[0.0, np.inf, 0.0, 3.0]])), [[np.inf, np.inf, np.inf, 3.0]]
    )
    assert np.isinf(graph.spread(np.full((1, 4), np.inf))).all()


def test_a_map_without_a_free_cell_is_no_error():
    assert np.isinf(GridGraph(np.zeros((4, 4), bool), 1.0).distance_from((1, 1))).all()


def test_a_tree_must_start_on_a_free_cell():
    with pytest.raises(ValueError, match=r"`cell` must be free, got \[0, 0\]"):
        GridGraph(parse("#."), 1.0).tree_from((0, 0))


def test_a_cost_must_have_the_shape_of_the_map():
    with pytest.raises(ValueError, match=r"`cost` must have shape \(1, 2\), got \(2, 1\)"):
        GridGraph(parse(".."), 1.0, np.ones((2, 1)))


def test_the_nearest_free_cell_is_found_within_the_limit():
    free = np.zeros((9, 9), bool)
    free[4, 7] = free[0, 0] = True
    assert nearest_free_cell(free, (4, 4), 3).tolist() == [4, 7]
    assert nearest_free_cell(free, (4, 4), 2) is None
    assert nearest_free_cell(free, (-2, 0), 2).tolist() == [0, 0]
    assert nearest_free_cell(free, (40, 0), 3) is None
    assert nearest_free_cell(free, (3, 3), 3) is None, "a corner of the square lies beyond the circle"
