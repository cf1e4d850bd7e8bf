"""A wave by sweeps against Dijkstra's algorithm on the same graph."""

import numpy as np
import pytest
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from agents.wave_sweeps import FAR_M, TOLERANCE_M, spread_wave


def by_dijkstra(seeds_m: np.ndarray, price_m: np.ndarray) -> np.ndarray:
    """Distances over one raster; one node more leads to all seeds."""
    index = np.arange(seeds_m.size).reshape(seeds_m.shape)
    dearest = np.max([price_m[1:, 1:], price_m[1:, :-1], price_m[:-1, 1:], price_m[:-1, :-1]], axis=0)
    diagonal = np.sqrt(2.0) * dearest
    begins = index[seeds_m < FAR_M]
    edges = [
        (index[:, 1:], index[:, :-1], 0.5 * (price_m[:, 1:] + price_m[:, :-1])),
        (index[1:], index[:-1], 0.5 * (price_m[1:] + price_m[:-1])),
        (index[1:, 1:], index[:-1, :-1], diagonal),
        (index[1:, :-1], index[:-1, 1:], diagonal),
        (np.full(len(begins), seeds_m.size), begins, seeds_m.reshape(-1)[begins] + 1e-9),
    ]
    start, end, length = (np.concatenate([edge[part].reshape(-1) for edge in edges]) for part in range(3))
    graph = coo_matrix((length, (start, end)), shape=(seeds_m.size + 1,) * 2).tocsr()
    return dijkstra(graph, directed=False, indices=seeds_m.size)[:-1].reshape(seeds_m.shape)


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (5, 7), (48, 48), (31, 64), (160, 160)])
@pytest.mark.parametrize("blocked_m", [0.2, 4.0, 40.0])
def test_waves_are_shortest_ways(shape: tuple[int, int], blocked_m: float) -> None:
    rng = np.random.default_rng(7)
    walls = rng.random((2, *shape)) < 0.02
    blocked = ndimage.binary_dilation(walls[0], np.ones((1, 9))) | ndimage.binary_dilation(
        walls[1], np.ones((9, 1))
    )
    price_m = np.where(blocked, blocked_m, 0.2).astype(np.float32)
    seeds_m = np.full(shape, FAR_M, np.float32)
    seeds_m[shape[0] // 2, shape[1] // 3] = 0.0
    seeds_m[-1] = 10.0 + 3.0 * rng.random(shape[1])
    wave = spread_wave(seeds_m, price_m, 200)
    np.testing.assert_allclose(wave, by_dijkstra(seeds_m, price_m), atol=3.0 * TOLERANCE_M)


def test_wave_does_not_run_on_from_row_to_row() -> None:
    """The end of a row is beside the start of the next in memory, but not on the floor."""
    price_m = np.full((6, 50), 1.0, np.float32)
    seeds_m = np.full_like(price_m, FAR_M)
    seeds_m[2, -1] = 0.0
    wave = spread_wave(seeds_m, price_m, 50)
    assert wave[3, 0] == pytest.approx(48.0 + np.sqrt(2.0), rel=1e-3)


def test_dear_way_is_found_before_one_from_line_to_line() -> None:
    price_m = np.full((48, 48), 40.0, np.float32)
    seeds_m = np.full_like(price_m, FAR_M)
    seeds_m[20, -1] = 0.0
    wave = spread_wave(seeds_m, price_m, 50)
    assert wave[20, 0] == pytest.approx(47 * 40.0, rel=1e-3)


def test_rounds_are_bounded() -> None:
    """The way zigzags between walls and has more bends than two rounds of sweeps carry a wave round."""
    price_m = np.full((41, 41), 1.0, np.float32)
    for wall in range(1, 40, 2):
        price_m[wall, slice(0, 40) if wall % 4 == 1 else slice(1, 41)] = 500.0
    seeds_m = np.full_like(price_m, FAR_M)
    seeds_m[0, 0] = 0.0
    few, many = (spread_wave(seeds_m, price_m, rounds)[-1, -1] for rounds in (2, 100))
    assert many < few
