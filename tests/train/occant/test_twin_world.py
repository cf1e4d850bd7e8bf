import numpy as np
import pytest

from anm_gym.scenes.scene import Scene, Storey
from anm_gym.sim.grid import GridFrame
from train.occant.twin_world import VOID_M, FanSettings, RayFan, TwinWorld

AHEAD_OF_MINUS_Z = np.array([[1.5, 2.8, 0.0]])
"""In the left room, looking along -z at the far wall."""


def seen_cells(world: TwinWorld, pose: np.ndarray, settings: FanSettings | None = None) -> np.ndarray:
    fan = RayFan(settings or FanSettings())
    visible = fan.visible(fan.tops(world, pose))
    cells = world.frame.cells_of(fan.points_xz(pose)[visible])
    mask = np.zeros(world.frame.shape, bool)
    mask[cells[:, 0], cells[:, 1]] = True
    return mask


def with_box(world: TwinWorld, height_m: float) -> TwinWorld:
    """Put a box across the left room, from z = 1.2 to 1.5 m."""
    top_m = world.top_m.copy()
    top_m[12:15, 1:30] = height_m
    return TwinWorld("box", world.frame, top_m, world.navigable)


def test_mesh_becomes_floor_walls_and_void(box_room) -> None:
    mesh = box_room(4.0, 3.0)
    scene = Scene("room", mesh, 0.0, 2.5, (Storey(0, 0.0, 2.5, 10.0),), "test")
    world = TwinWorld.of(scene, 0.1)
    heights = world.tops_at(np.array([[0.0, 0.0], [2.0, 0.0], [2.4, 0.0], [50.0, 0.0]]))
    assert heights == pytest.approx([0.0, 1.5, VOID_M, VOID_M])
    assert world.is_navigable(np.array([0.0, 0.0]))
    assert not world.is_navigable(np.array([1.97, 0.0]))
    assert not world.is_navigable(np.array([50.0, 0.0]))
    assert world.layout_m2 == pytest.approx(4.0 * 3.0, rel=0.12)


def test_wall_hides_what_is_behind_it(twin_rooms: TwinWorld) -> None:
    seen = seen_cells(twin_rooms, np.array([[1.5, 1.0, -np.pi / 2]]))
    assert seen[10, 29]
    assert not seen[3, 31:].any()
    through_the_door = seen_cells(twin_rooms, np.array([[1.5, 1.55, -np.pi / 2]]))
    assert through_the_door[15, 40]


@pytest.mark.parametrize(("height_m", "is_seen"), [(0.45, True), (1.2, False), (1.5, False)])
def test_camera_looks_over_what_is_low(twin_rooms: TwinWorld, height_m: float, is_seen: bool) -> None:
    seen = seen_cells(with_box(twin_rooms, height_m), AHEAD_OF_MINUS_Z)
    assert seen[14, 15]
    assert bool(seen[2, 15]) is is_seen


def test_floor_at_the_feet_is_not_in_view(twin_rooms: TwinWorld) -> None:
    seen = seen_cells(twin_rooms, AHEAD_OF_MINUS_Z)
    assert not seen[17:, 15].any()
    assert seen[14, 15]


def test_void_is_not_seen_and_hides_nothing(twin_rooms: TwinWorld) -> None:
    seen = seen_cells(with_box(twin_rooms, VOID_M), AHEAD_OF_MINUS_Z)
    assert not seen[12:15, 1:30].any()
    assert seen[2, 15]


def test_sweep_goes_over_furniture_up_to_the_wall(twin_rooms: TwinWorld) -> None:
    fan = RayFan(FanSettings())
    points = fan.points_xz(AHEAD_OF_MINUS_Z)[0]
    swept = fan.swept(fan.tops(with_box(twin_rooms, 0.95), AHEAD_OF_MINUS_Z), wall_m=1.0)[0]
    middle = len(swept[0]) // 2
    assert points[swept[:, middle], middle, 1].min() == pytest.approx(0.05, abs=0.06)


def test_world_has_a_place_to_start(twin_rooms: TwinWorld) -> None:
    assert twin_rooms.navigable[tuple(twin_rooms.starts[0])]
    assert isinstance(twin_rooms.frame, GridFrame)
