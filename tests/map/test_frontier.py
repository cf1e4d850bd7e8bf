import numpy as np
import pytest

from anm_gym.geometry import forward_xz
from anm_gym.map.frontier import find_frontiers
from anm_gym.sim.grid import GridFrame

FRAME = GridFrame((-1.0, 2.0), 0.1, (40, 60))


def room() -> tuple[np.ndarray, np.ndarray]:
    """Free and unknown cells of a closed room in an unknown world."""
    free = np.zeros(FRAME.shape, bool)
    free[10:30, 10:40] = True
    wall = np.zeros(FRAME.shape, bool)
    wall[9:31, 9:41] = True
    return free, ~(free | wall)


def test_closed_room_has_no_frontier() -> None:
    assert find_frontiers(*room(), FRAME, min_size_m=0.0) == []


def test_room_with_one_door_has_one_frontier_in_the_door_that_looks_out() -> None:
    free, unknown = room()
    free[30, 20:29] = True
    (frontier,) = find_frontiers(free, unknown, FRAME, min_size_m=0.5)
    assert frontier.size_m == pytest.approx(0.9)
    assert frontier.center_xz == pytest.approx(FRAME.centers_of((30, 24))[0])
    assert {tuple(cell) for cell in frontier.cells} == {(30, column) for column in range(20, 29)}
    assert forward_xz(frontier.outward_rad) == pytest.approx([0.0, 1.0], abs=0.2)


def test_short_frontier_is_dropped() -> None:
    free, unknown = room()
    free[30, 20:24] = True
    assert find_frontiers(free, unknown, FRAME, min_size_m=0.5) == []
    assert len(find_frontiers(free, unknown, FRAME, min_size_m=0.4)) == 1


def test_cells_that_touch_at_corners_are_one_frontier() -> None:
    free, unknown = room()
    free[30, 20:24] = True
    unknown[29, 24:28] = True
    free[29, 24:28] = False
    assert len(find_frontiers(free, unknown, FRAME, min_size_m=0.0)) == 1


def test_long_frontier_is_cut_into_equal_parts_across() -> None:
    free, unknown = room()
    unknown[30, 10:40] = True
    parts = find_frontiers(free, unknown, FRAME, min_size_m=0.5, max_size_m=1.0)
    assert [part.size_m for part in parts] == pytest.approx([1.0, 1.0, 1.0])
    assert sorted(part.center_xz[0] for part in parts) == pytest.approx([0.5, 1.5, 2.5], abs=0.11)


def test_two_doors_are_two_frontiers() -> None:
    free, unknown = room()
    free[30, 12:20] = free[15:24, 40] = True
    assert len(find_frontiers(free, unknown, FRAME, min_size_m=0.5)) == 2


def test_frontier_of_large_cells_has_a_direction() -> None:
    free = np.zeros((5, 5), bool)
    free[2, 1:4] = True
    frontiers = find_frontiers(free, ~free, GridFrame(np.zeros(2), 1.0, free.shape), min_size_m=1.0)
    assert frontiers
    assert all(np.isfinite(frontier.outward_rad) for frontier in frontiers)


def test_rasters_must_fit() -> None:
    with pytest.raises(ValueError, match="same shape"):
        find_frontiers(np.zeros((2, 2), bool), np.zeros((2, 3), bool), FRAME, min_size_m=0.0)


@pytest.mark.parametrize("sizes", [(-0.1, 1.0), (0.1, 0.0)])
def test_sizes_must_be_positive(sizes: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="must be >= 0"):
        find_frontiers(*room(), FRAME, *sizes)
