import numpy as np
import pytest

from anm_gym.sim.grid import GridFrame
from anm_gym.sim.raster import rasterise_slab

FRAME = GridFrame((0.0, 0.0), 0.1, (20, 30))


def rasterise(triangles, low_y_m=-1.0, high_y_m=1.0):
    return rasterise_slab(np.asarray(triangles, np.float64).reshape(-1, 3, 3), FRAME, low_y_m, high_y_m)


def wall(x, low_z, high_z, low_y=0.0, high_y=2.0):
    """Split an upright rectangle of no thickness into two triangles."""
    a, b, c, d = (x, low_y, low_z), (x, low_y, high_z), (x, high_y, high_z), (x, high_y, low_z)
    return [[a, b, c], [a, c, d]]


def split(triangles):
    """Split each triangle into four at the middles of its edges."""
    a, b, c = np.asarray(triangles).transpose(1, 0, 2)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(part, axis=1) for part in parts])


def test_a_wall_without_thickness_fills_one_column_of_cells():
    marked = rasterise(wall(1.55, 0.42, 1.38))
    expected = np.zeros(FRAME.shape, bool)
    expected[4:14, 15] = True
    np.testing.assert_array_equal(marked, expected)


def test_a_slanted_wall_leaves_no_gap_between_cells():
    a, b = (0.03, 0.0, 0.04), (2.87, 0.0, 1.93)
    up = np.array([0.0, 1.0, 0.0])
    marked = rasterise([[a, b, b + up], [a, b + up, a + up]])
    along = np.linspace(a, b, 5000)[:, [0, 2]]
    cells = FRAME.cells_of(along)
    expected = np.zeros(FRAME.shape, bool)
    expected[cells[:, 0], cells[:, 1]] = True
    assert not (expected & ~marked).any()
    assert marked.sum() <= expected.sum() + 1


def test_a_floor_triangle_marks_the_cells_it_overlaps_and_no_others():
    marked = rasterise([[(0.52, 0.0, 0.52), (1.48, 0.0, 0.52), (0.52, 0.0, 1.48)]])
    assert marked[5:15, 5].all()
    assert marked[5, 5:15].all()
    assert not marked[14, 14]
    assert not marked[:5].any()
    rows, columns = np.nonzero(marked)
    assert (rows + columns).max() == 20, "a cell over the slanted edge would be counted"


def test_only_the_part_within_the_slab_counts():
    ramp = [[(0.05, 0.0, 0.05), (2.05, 2.0, 0.05), (0.05, 0.0, 0.06)]]
    assert np.flatnonzero(rasterise(ramp, 0.52, 1.18)[0]).tolist() == list(range(5, 13))
    assert not rasterise(ramp, 2.1, 3.0).any()


def test_a_triangle_that_pierces_the_slab_without_a_corner_inside_counts():
    assert rasterise(wall(1.55, 0.42, 1.38, low_y=-5.0, high_y=5.0), 0.1, 0.2).sum() == 10


def test_the_tessellation_of_a_surface_makes_no_difference(rng):
    triangles = rng.uniform([-0.3, -0.5, -0.3], [3.3, 2.0, 2.3], (40, 3, 3))
    expected = rasterise(triangles, 0.1, 1.5)
    assert 0.1 < expected.mean() < 0.99
    np.testing.assert_array_equal(rasterise(split(split(triangles)), 0.1, 1.5), expected)
    np.testing.assert_array_equal(rasterise(triangles[:, [2, 1, 0]], 0.1, 1.5), expected)


def test_triangles_outside_the_raster_are_left_out():
    far = [[(50.0, 0.0, 50.0), (51.0, 0.0, 50.0), (50.0, 0.0, 51.0)]]
    assert not rasterise(far).any()
    assert not rasterise(np.empty((0, 3, 3))).any()


def test_a_triangle_larger_than_the_raster_fills_it():
    assert rasterise([[(-50.0, 0.0, -50.0), (50.0, 0.0, -50.0), (0.0, 0.0, 90.0)]]).all()


def test_a_slab_must_not_be_upside_down():
    with pytest.raises(ValueError, match=r"`low_y_m` must be <= `high_y_m`, got 1\.0 and 0\.0"):
        rasterise(wall(0.5, 0.0, 1.0), 1.0, 0.0)
