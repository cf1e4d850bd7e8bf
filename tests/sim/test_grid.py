import copy

import numpy as np
import pytest

from anm_gym.sim.grid import GridFrame

FRAME = GridFrame((-1.0, 2.0), 0.5, (4, 6))


def test_rows_run_along_z_and_columns_along_x():
    assert FRAME.cells_of([-0.9, 2.1]).tolist() == [[0, 0]]
    assert FRAME.cells_of([[0.6, 2.1], [-0.9, 3.1]]).tolist() == [[0, 3], [2, 0]]


def test_a_cell_holds_its_centre(rng):
    cells = np.stack([rng.integers(-9, 9, 50), rng.integers(-9, 9, 50)], axis=1)
    np.testing.assert_array_equal(FRAME.cells_of(FRAME.centers_of(cells)), cells)
    np.testing.assert_allclose(FRAME.centers_of([1, 2]), [[0.25, 2.75]])


def test_only_cells_of_the_raster_are_contained():
    assert FRAME.contains([[0, 0], [3, 5], [4, 0], [0, 6], [-1, 0]]).tolist() == [
        True,
        True,
        False,
        False,
        False,
    ]


def test_a_frame_around_two_corners_covers_them_and_the_margin():
    frame = GridFrame.around((-1.0, -2.0), (3.0, 1.0), cell_m=0.3, margin_m=0.5)
    assert frame.origin_xz == (-1.5, -2.5)
    assert frame.contains(frame.cells_of([[-1.5, -2.5], [3.49, 1.49]])).all()
    assert frame.shape == (14, 17)


def test_a_frame_survives_a_deep_copy():
    assert copy.deepcopy(FRAME) == FRAME


def test_a_cell_must_have_an_extent():
    with pytest.raises(ValueError, match=r"`cell_m` must be > 0, got 0\.0"):
        GridFrame((0.0, 0.0), 0.0, (1, 1))


def test_a_frame_must_have_a_cell():
    with pytest.raises(ValueError, match="at least one row and one column"):
        GridFrame((0.0, 0.0), 0.1, (0, 3))
