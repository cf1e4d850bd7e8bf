import numpy as np
import pytest

from agents.layout_memory import (
    EXPLORED,
    OCCUPIED,
    VIEW_CHANNELS,
    LayoutMemory,
    LayoutSettings,
    points_to_world,
    start_poses,
)

SETTINGS = LayoutSettings(map_cells=200, view_cells=16, pool=4)


@pytest.fixture
def memory() -> LayoutMemory:
    return LayoutMemory(SETTINGS)


def patch(*, wall_ahead_m: float | None = None) -> np.ndarray:
    """Floor 4 m ahead and 1 m to either side, with a wall across it."""
    values = np.zeros((1, 2, 64, 64), np.float32)
    values[0, EXPLORED, 24:, 22:42] = 1.0
    if wall_ahead_m is not None:
        row = 63 - round(wall_ahead_m / 0.1)
        values[0, OCCUPIED, row, 22:42] = 1.0
    return values


def test_look_lands_ahead_of_the_agent(memory: LayoutMemory) -> None:
    memory.add(patch(wall_ahead_m=2.0), np.zeros((1, 3)))
    row, column = memory.frame.cells_of([0.0, -2.05])[0]
    assert memory.grid.probabilities[OCCUPIED, row, column] == pytest.approx(1.0)
    behind = memory.frame.cells_of([0.0, 1.0])[0]
    assert memory.grid.probabilities[EXPLORED, behind[0], behind[1]] == 0.0


def test_look_to_the_left_lands_on_the_left(memory: LayoutMemory) -> None:
    memory.add(patch(wall_ahead_m=2.0), np.array([[0.0, 0.0, np.pi / 2]]))
    row, column = memory.frame.cells_of([-2.05, 0.0])[0]
    assert memory.grid.probabilities[OCCUPIED, row, column] > 0.9


def test_known_cells_keep_nine_tenths_of_what_they_were(memory: LayoutMemory) -> None:
    memory.add(patch(wall_ahead_m=2.0), np.zeros((1, 3)))
    memory.add(patch(), np.zeros((1, 3)))
    row, column = memory.frame.cells_of([0.0, -2.05])[0]
    assert memory.grid.probabilities[OCCUPIED, row, column] == pytest.approx(0.9)


def test_view_has_its_channels_in_range(memory: LayoutMemory) -> None:
    memory.add(patch(), np.zeros((1, 3)))
    view = memory.view(np.zeros(3))
    assert view.shape == (VIEW_CHANNELS, 16, 16)
    assert view.dtype == np.float32
    assert view.min() >= 0.0
    assert view.max() <= 1.0


def test_view_is_centred_on_the_agent_at_both_scales(memory: LayoutMemory) -> None:
    place = np.array([[2.0, 3.0]])
    memory.visit(place)
    view = memory.view(np.array([2.0, 3.0, 0.0]))
    near, far = view[2], view[5]
    assert near[7:9, 7:9].all()
    assert far[7:9, 7:9].all()
    assert near.sum() == 9
    assert far.sum() == 4


def test_each_goal_is_where_the_view_shows_it(memory: LayoutMemory) -> None:
    pose = np.array([1.0, -1.0, 0.3])
    for goal in (0, 15, 100, 255):
        point = memory.goal_xz(goal, pose)
        memory.visited[:] = 0.0
        memory.visit(point[None])
        row, column = np.unravel_index(memory.view(pose)[5].argmax(), (16, 16))
        assert abs(row * 16 + column - goal) in {0, 1, 16, 17}
    assert memory.goal_xz(0, pose) == pytest.approx([1.0 - 3.0, -1.0 - 3.0], abs=0.06)


@pytest.mark.parametrize("heading_rad", [0.0, np.pi / 2, -2.0])
def test_goals_ahead_are_told_from_those_behind(memory: LayoutMemory, heading_rad: float) -> None:
    pose = np.array([0.0, 0.0, heading_rad])
    view = memory.view(pose)
    offsets = np.array([memory.goal_xz(goal, pose) for goal in range(256)])
    ahead = offsets @ (-np.sin(heading_rad), -np.cos(heading_rad))
    left = offsets @ (-np.cos(heading_rad), np.sin(heading_rad))
    assert ((view[7].ravel() > 0.5) == (ahead > 0.0)).all()
    assert ((view[8].ravel() > 0.5) == (left > 0.0)).all()
    assert view[6].ravel().argmax() in {7 * 16 + 7, 7 * 16 + 8, 8 * 16 + 7, 8 * 16 + 8}


def test_agent_at_the_rim_of_the_map_sees_nothing_beyond(memory: LayoutMemory) -> None:
    view = memory.view(np.array([9.9, 9.9, 0.0]))
    assert not view[:6].any()
    memory.visit(np.array([[100.0, 100.0]]))
    assert not memory.visited.any()


def test_frames_of_start_and_world_are_inverse(rng: np.random.Generator) -> None:
    start = np.array([2.0, -1.0, 0.7])
    poses = rng.normal(size=(5, 3))
    assert points_to_world(start_poses(poses, start)[:, :2], start) == pytest.approx(poses[:, :2])
    assert start_poses(start, start) == pytest.approx(np.zeros((1, 3)))
    ahead = start[:2] + 2.0 * np.array([-np.sin(0.7), -np.cos(0.7)])
    assert start_poses(np.append(ahead, 0.7), start)[0] == pytest.approx([0.0, -2.0, 0.0], abs=1e-9)


def test_odd_views_are_refused() -> None:
    with pytest.raises(ValueError, match="`view_cells` must be even"):
        LayoutSettings(view_cells=15)
