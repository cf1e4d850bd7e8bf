import numpy as np
import pytest

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.map.occupancy import OccupancyGrid
from anm_gym.map.reach import ReachableSpace, ReachSettings, reachable_space
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.backends import make_depth_camera
from anm_gym.sim.grid import GridFrame

CAMERA = CameraSpec(width_px=128, height_px=128)


@pytest.fixture
def seen(two_rooms: TriangleMesh) -> OccupancyGrid:
    """Both rooms, seen from the middle of each."""
    renderer, grid = make_depth_camera(two_rooms, CAMERA), OccupancyGrid(floor_y_m=0.0)
    for x in (-2.0, 2.0):
        for heading in np.deg2rad(np.arange(0.0, 360.0, 45.0)):
            pose = camera_pose((x, 1.25, 0.01), heading)
            grid.integrate(renderer.render(pose), CAMERA, pose)
    return grid


def test_straight_way_through_a_wide_door_costs_its_length(seen: OccupancyGrid) -> None:
    space = reachable_space(seen, (-2.0, 0.0), ReachSettings(comfort_m=0.2))
    assert space is not None
    assert space.cost_to((2.0, 0.0)) == pytest.approx(4.0, abs=0.15)


def test_way_to_the_next_room_goes_round_the_wall(seen: OccupancyGrid) -> None:
    space = reachable_space(seen, (-0.5, 1.5))
    assert space is not None
    assert space.cost_to((0.5, 1.5)) > 2.2


def test_what_is_behind_a_wall_is_reached_only_through_the_tolerance(seen: OccupancyGrid) -> None:
    space = reachable_space(seen, (-2.0, 0.0))
    assert space is not None
    assert np.isinf(space.cost_to((-2.0, 2.2)))
    assert space.cost_to((-2.0, 2.2), tolerance_m=0.6) == pytest.approx(2.0, abs=0.5)


def test_tolerance_reaches_cells_that_are_as_far_as_it_is() -> None:
    """0.3 m are six cells of 5 cm, though 0.3 / 0.05 is less than 6 in floating point."""
    cost_m = np.full((20, 20), np.inf)
    cost_m[10, 10] = 1.0
    space = ReachableSpace(GridFrame(np.zeros(2), 0.05, cost_m.shape), cost_m)
    away = space.frame.centers_of(np.array([10, 16]))[0]
    assert space.cost_to(away, tolerance_m=0.3) == 1.0
    assert np.isinf(space.cost_to(away, tolerance_m=0.25))


def test_unknown_floor_is_passable_on_request(seen: OccupancyGrid) -> None:
    known = reachable_space(seen, (-2.0, 0.0))
    bold = reachable_space(seen, (-2.0, 0.0), ReachSettings(through_unknown=True))
    assert known is not None
    assert bold is not None
    assert bold.reachable.sum() >= known.reachable.sum()


def test_agent_that_is_walled_in_reaches_nothing(seen: OccupancyGrid) -> None:
    assert reachable_space(seen, (30.0, 30.0)) is None


def test_agent_that_would_be_caught_squeezes_through(seen: OccupancyGrid) -> None:
    roomy = reachable_space(seen, (-2.0, 0.0))
    caught = ReachSettings(radius_m=0.55, pocket_m2=0.0)  # wider than half the door
    assert roomy is not None
    left_room = reachable_space(seen, (-2.0, 0.0), caught)
    assert left_room is not None
    assert left_room.area_m2 < 0.4 * roomy.area_m2
    squeezing = ReachSettings(radius_m=0.55, tight_radius_m=0.15, pocket_m2=left_room.area_m2 + 1.0)
    freed = reachable_space(seen, (-2.0, 0.0), squeezing)
    assert freed is not None
    assert freed.area_m2 == pytest.approx(roomy.area_m2)
    no_help = ReachSettings(radius_m=0.55, pocket_m2=1000.0)
    still_caught = reachable_space(seen, (-2.0, 0.0), no_help)
    assert still_caught is not None
    assert still_caught.area_m2 == left_room.area_m2
