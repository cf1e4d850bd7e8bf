"""What of a floor is indoors, and which gaps in it are none."""

import numpy as np
import pytest

from anm_gym.mesh import TriangleMesh
from anm_gym.sim.indoors import between_walls, bridged
from anm_gym.sim.traversable import TraversableGrid


@pytest.mark.parametrize("gap_cells", [1, 2, 3, 4])
def test_gaps_up_to_a_width_are_bridged(gap_cells):
    floor = np.ones((9, 20), bool)
    floor[:, 8 : 8 + gap_cells] = False
    for width in range(1, 6):
        assert bridged(floor, width).all() == (width >= gap_cells)


def test_bridging_adds_nothing_at_the_border_of_a_floor():
    floor = np.zeros((12, 12), bool)
    floor[3:9, 2:10] = True
    for width in (3, 4):
        np.testing.assert_array_equal(bridged(floor, width), floor)


def test_room_with_a_door_is_between_walls_and_the_place_before_it_is_not():
    occupied = np.zeros((40, 40), bool)
    occupied[10:31, [10, 30]] = occupied[[10, 30], 10:31] = True
    occupied[10, 18:23] = False
    inside = between_walls(occupied, 25)
    assert inside[20, 20]
    assert inside[12:29, 12:29].mean() > 0.95
    assert not inside[5, 20]
    assert not inside[:9].any()
    assert not between_walls(occupied, 5)[20, 20], "walls are too far away"


@pytest.mark.parametrize(("gap_m", "parts"), [(0.1, 1), (0.2, 1), (0.4, 2)])
def test_floors_that_end_at_the_walls_are_one_floor(two_rooms, gap_m, parts):
    """A floor for each room, and none under the door between them."""
    is_floor = two_rooms.triangles[:, :, 1].max(axis=1) < 0.01
    low, high = two_rooms.bounds[:, [0, 2]]
    pieces = [(low[0], -0.5 * gap_m), (0.5 * gap_m, high[0])]
    corners = [
        [x, 0.0, z]
        for x0, x1 in pieces
        for x, z in zip((x0, x1, x1, x0), (low[1], low[1], high[1], high[1]), strict=True)
    ]
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]) + len(two_rooms.vertices)
    mesh = TriangleMesh(
        np.concatenate([two_rooms.vertices, corners]),
        np.concatenate([two_rooms.faces[~is_floor], faces]).astype(np.int32),
    )
    areas_m2 = TraversableGrid.from_mesh(mesh, 0.0).component_areas_m2
    assert sum(area_m2 > 1.0 for area_m2 in areas_m2) == parts
