"""The nearest place of the largest part, against a search by hand."""

from dataclasses import replace

import numpy as np
import pytest

from anm_gym.envs.largest_part import LARGEST, is_open_between, nearest_place
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.traversable import TraversableGrid


@pytest.fixture(scope="module")
def grid(two_rooms: TriangleMesh) -> TraversableGrid:
    return TraversableGrid.from_mesh(two_rooms, 0.0)


def test_no_cell_of_the_part_is_nearer(grid: TraversableGrid, rng: np.random.Generator) -> None:
    cells = np.argwhere(grid.component == LARGEST)
    for position_xz in rng.uniform(-5.0, 5.0, (20, 2)):
        found = nearest_place(grid, position_xz)
        assert found is not None
        assert grid.component_at(found) == LARGEST
        shortest_m = min(np.linalg.norm(grid.frame.centers_of(cell)[0] - position_xz) for cell in cells)
        assert np.linalg.norm(found - position_xz) == pytest.approx(shortest_m)


def test_floor_without_room_for_the_body_has_no_place(grid: TraversableGrid) -> None:
    full = replace(grid, component=np.zeros_like(grid.component))
    assert nearest_place(full, (1.0, 0.0)) is None


@pytest.mark.parametrize(
    ("from_xz", "to_xz", "expected"),
    [
        ((-1.0, 1.0), (-0.2, 1.0), True),
        ((-0.2, 1.0), (0.2, 1.0), False),
        ((0.02, 1.0), (0.2, 1.0), True),
        ((-0.2, 0.0), (0.2, 0.1), True),
        ((-0.2, 1.0), (-0.2, 1.0), True),
    ],
)
def test_walls_are_between_but_not_where_the_line_begins(
    grid: TraversableGrid, from_xz: tuple[float, float], to_xz: tuple[float, float], expected: bool
) -> None:
    assert is_open_between(grid, from_xz, to_xz) is expected
