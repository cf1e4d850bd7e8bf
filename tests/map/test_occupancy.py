from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from anm_gym.geometry import CameraSpec, camera_pose
from anm_gym.map.occupancy import OccupancyGrid, OccupancySettings, _View, clearance_of
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.backends import make_depth_camera

CAMERA = CameraSpec(width_px=128, height_px=128)
POSE = camera_pose((0.0, 1.25, 0.0), 0.0)


def label_at(grid: OccupancyGrid, x: float, z: float) -> str:
    """Name the label of the cell at a floor point."""
    cell = grid.frame.cells_of((x, z))
    if not grid.frame.contains(cell)[0]:
        return "outside"
    row, column = cell[0]
    labels = {"occupied": grid.occupied, "free": grid.free, "unknown": grid.unknown}
    return next(name for name, raster in labels.items() if raster[row, column])


def floor_depth(spec: CameraSpec = CAMERA, height_m: float = 1.25) -> NDArray[np.float32]:
    """Depth of an endless floor and nothing else."""
    down = -spec.directions[..., 1]
    depth = np.divide(height_m, down, out=np.zeros_like(down), where=down > 0.0)
    return np.where(depth <= spec.max_depth_m, depth, 0.0).astype(np.float32)


def with_obstacle(
    depth_m: NDArray[np.float32], at_m: float, low_m: float, high_m: float, side_m: tuple[float, float]
) -> NDArray[np.float32]:
    """Put an upright board across the view at some depth, between two heights and two sides."""
    x, y = CAMERA.directions[..., 0] * at_m, CAMERA.directions[..., 1] * at_m + 1.25
    board = (y >= low_m) & (y <= high_m) & (x >= side_m[0]) & (x <= side_m[1])
    nearer = board & ((depth_m == 0.0) | (depth_m > at_m))
    return np.where(nearer, np.float32(at_m), depth_m)


@pytest.fixture
def grid() -> OccupancyGrid:
    return OccupancyGrid(floor_y_m=0.0)


def test_turn_in_a_closed_room_shows_its_floor_and_walls_and_nothing_behind_them(
    grid: OccupancyGrid, box_room: Callable[..., TriangleMesh]
) -> None:
    renderer = make_depth_camera(box_room(4.0, 3.0), CAMERA)
    for heading in np.deg2rad(np.arange(0.0, 360.0, 30.0)):
        pose = camera_pose((0.01, 1.25, 0.02), heading)
        grid.integrate(renderer.render(pose), CAMERA, pose)
    free = grid.frame.centers_of(np.argwhere(grid.free))
    assert (np.abs(free) < [2.05, 1.55]).all()
    assert 11.0 < len(free) * 0.05**2 <= 12.0
    walls = grid.frame.centers_of(np.argwhere(grid.occupied))
    gap = np.abs(np.abs(walls) - [2.0, 1.5]).min(axis=1)
    assert (gap <= 0.05).all()


def test_labels_are_exclusive_and_complete(grid: OccupancyGrid) -> None:
    grid.integrate(with_obstacle(floor_depth(), 2.0, 0.0, 1.0, (-0.5, 0.5)), CAMERA, POSE)
    assert (grid.free.astype(int) + grid.occupied + grid.unknown == 1).all()


def test_floor_before_a_board_is_free_and_behind_it_unknown(grid: OccupancyGrid) -> None:
    grid.integrate(with_obstacle(floor_depth(), 2.02, 0.0, 2.5, (-0.5, 0.5)), CAMERA, POSE)
    assert label_at(grid, 0.0, -1.9) == "free"
    assert label_at(grid, 0.0, -2.02) == "occupied"
    assert label_at(grid, 0.0, -2.6) == "unknown"
    assert label_at(grid, 2.4, -3.0) == "free"


@pytest.mark.parametrize(
    ("low_m", "high_m", "expected"),
    [(0.0, 0.08, "free"), (0.0, 0.2, "occupied"), (1.4, 2.0, "occupied"), (1.6, 2.5, "free")],
)
def test_only_obstacles_at_the_height_of_the_body_count(
    grid: OccupancyGrid, low_m: float, high_m: float, expected: str
) -> None:
    grid.integrate(with_obstacle(floor_depth(), 2.01, low_m, high_m, (-0.5, 0.5)), CAMERA, POSE)
    assert label_at(grid, 0.0, -2.01) == expected


def test_thin_leg_is_not_erased_by_rays_that_pass_it(grid: OccupancyGrid) -> None:
    leg = with_obstacle(floor_depth(), 1.52, 0.0, 0.7, (0.0, 0.03))
    grid.integrate(leg, CAMERA, POSE)
    for _ in range(9):
        grid.integrate(floor_depth(), CAMERA, POSE)
    assert label_at(grid, 0.015, -1.52) == "occupied"


def test_outlier_fades(grid: OccupancyGrid) -> None:
    grid.integrate(with_obstacle(floor_depth(), 1.52, 0.0, 0.7, (0.0, 0.03)), CAMERA, POSE)
    for _ in range(11):
        grid.integrate(floor_depth(), CAMERA, POSE)
    assert label_at(grid, 0.015, -1.52) == "free"


def test_contact_stays_whatever_is_seen(grid: OccupancyGrid) -> None:
    grid.integrate(floor_depth(), CAMERA, POSE)
    grid.mark_blocked((0.3, -2.0))
    for _ in range(12):
        grid.integrate(floor_depth(), CAMERA, POSE)
    assert label_at(grid, 0.3, -2.0) == "occupied"
    assert not grid.traversable(0.1)[tuple(grid.frame.cells_of((0.38, -2.0))[0])]


def test_contact_stays_however_often_it_is_repeated(grid: OccupancyGrid) -> None:
    grid.integrate(floor_depth(), CAMERA, POSE)
    for _ in range(3000):
        grid.mark_blocked((0.3, -2.0))
    assert label_at(grid, 0.3, -2.0) == "occupied"


def test_contact_is_a_line_across_the_way(grid: OccupancyGrid) -> None:
    grid.integrate(floor_depth(), CAMERA, POSE)
    grid.mark_contact(POSE)
    assert [label_at(grid, x, -0.15) for x in (-0.05, 0.0, 0.05)] == ["occupied"] * 3
    assert grid.occupied.sum() == 3


def test_grid_below_a_camera_lies_on_its_floor() -> None:
    assert OccupancyGrid.below(CAMERA, POSE).floor_y_m == pytest.approx(POSE[1, 3] - CAMERA.sensor_height_m)


def test_edge_of_the_floor_is_not_free(grid: OccupancyGrid) -> None:
    depth = floor_depth()
    depth[depth > 2.0] = 0.0
    grid.integrate(depth, CAMERA, POSE)
    assert label_at(grid, 0.0, -1.8) == "free"
    beyond = [label_at(grid, 0.0, z) for z in np.arange(-2.1, -3.9, -0.05)]
    assert "occupied" in beyond
    assert "free" not in beyond


def test_empty_pixels_say_nothing_if_the_camera_is_blind_nearby(grid: OccupancyGrid) -> None:
    camera = CameraSpec(width_px=128, height_px=128, min_depth_m=0.5)
    grid.integrate(np.zeros((128, 128), np.float32), camera, POSE)
    assert not grid.occupied.any()


def test_floor_underfoot_is_assumed_free_until_something_is_hit_there(grid: OccupancyGrid) -> None:
    grid.integrate(floor_depth(), CAMERA, POSE)
    assert label_at(grid, 0.0, 0.0) == "free"
    assert label_at(grid, 0.0, -0.6) == "free"
    back = camera_pose((0.0, 1.25, 1.6), 0.0)
    grid.integrate(with_obstacle(floor_depth(), 2.22, 0.0, 0.4, (-0.3, 0.3)), CAMERA, back)
    assert label_at(grid, 0.0, -0.62) == "occupied"


def test_growing_keeps_what_was_known_where_it_was(grid: OccupancyGrid) -> None:
    grid.integrate(with_obstacle(floor_depth(), 2.02, 0.0, 1.0, (-0.5, 0.5)), CAMERA, POSE)
    known = {tuple(np.round(xz, 3)) for xz in grid.frame.centers_of(np.argwhere(grid.occupied))}
    grid.integrate(floor_depth(), CAMERA, camera_pose((-20.0, 1.25, 13.0), 0.5))
    assert known == {tuple(np.round(xz, 3)) for xz in grid.frame.centers_of(np.argwhere(grid.occupied))}
    assert label_at(grid, -20.0, 13.0) == "free"


def test_clearance_is_the_distance_between_cells() -> None:
    occupied = np.zeros((5, 9), bool)
    occupied[2, 0] = True
    assert clearance_of(occupied, 0.05)[2, 8] == pytest.approx(0.4)
    assert np.isinf(clearance_of(np.zeros((2, 2), bool), 0.05)).all()


def test_unknown_cells_are_traversable_only_on_request(grid: OccupancyGrid) -> None:
    grid.integrate(floor_depth(), CAMERA, POSE)
    assert not (grid.traversable(0.1) & grid.unknown).any()
    assert (grid.traversable(0.1, through_unknown=True) & grid.unknown).any()


def test_agent_fits_where_it_has_stood(grid: OccupancyGrid) -> None:
    grid.integrate(floor_depth(), CAMERA, POSE)
    for side in (-0.1, 0.0, 0.1):
        grid.mark_blocked((side, -0.1))
    row, column = grid.frame.cells_of((0.0, 0.0))[0]
    assert grid.clearance_m[row, column] <= 0.15
    assert grid.traversable(0.15)[row, column]
    assert grid.stood.sum() * grid.cell_m**2 < 0.03


def test_version_tells_of_every_change(grid: OccupancyGrid) -> None:
    grid.integrate(floor_depth(), CAMERA, POSE)
    grid.mark_blocked((0.0, 0.0))
    assert grid.version == 2
    assert grid.cell_m == 0.05


def test_leaning_camera_is_refused(grid: OccupancyGrid) -> None:
    pose = POSE.copy()
    pose[1:3, 1:3] = [[0.8, -0.6], [0.6, 0.8]]
    with pytest.raises(ValueError, match="must be level"):
        grid.integrate(floor_depth(), CAMERA, pose)


def test_grid_without_a_frame_has_no_cells(grid: OccupancyGrid) -> None:
    with pytest.raises(ValueError, match="must have seen a frame"):
        _ = grid.frame


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cell_m": 0.0}, "`cell_m` must be > 0"),
        ({"max_range_m": -1.0}, "`max_range_m`"),
        ({"obstacle_min_m": 2.0}, "in"),
    ],
)
def test_bad_settings_are_refused(change: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        OccupancySettings(**change)


def test_rays_of_a_column_pass_the_union_of_what_each_passes(rng: np.random.Generator) -> None:
    camera = CameraSpec(width_px=16, height_px=64)
    depth_m = rng.uniform(0.0, 9.0, (64, 16)).astype(np.float32)
    settings = OccupancySettings()
    view = _View(depth_m, camera, np.eye(4), -1.25, settings)
    down, depths, floor_m = view._downward()
    first = np.rint(
        np.maximum((np.float32(1.25) - np.float32(settings.carve_height_m)) / down, 0.0) / view.bin_m
    )
    last = np.rint(np.where(depths <= floor_m, depths, 0.0) / view.bin_m)
    bins = np.arange(400)[:, None, None]
    expected = np.argwhere(((first <= bins) & (bins < last)).any(axis=1))
    x, z = view.passed()
    ahead = np.rint(-z / view.bin_m - 0.5).astype(int)
    column = np.abs(view.side - (x / -z)[:, None]).argmin(axis=1)
    assert len(expected) > 100
    assert set(zip(ahead, column, strict=True)) == {(row[0], row[1]) for row in expected}
