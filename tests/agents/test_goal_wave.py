"""The wave from the goal: distances over free cells, round what is blocked, never through a wall's corner."""

from dataclasses import replace

import numpy as np
import pytest

from agents.ego_memory import EgoMemory, EgoMemorySettings
from agents.goal_wave import DRIFT_SHARE, GoalWave, GoalWaveSettings, spread_wave
from agents.navigator_net import NavigatorNetSettings
from anm_gym.actions import Action
from anm_gym.geometry import CameraSpec, camera_pose

SETTINGS = GoalWaveSettings()
HERE = np.zeros((1, 2), np.float32)
WINDOW = (1, SETTINGS.window_cells, SETTINGS.window_cells)


def spread(goal: tuple[float, float], blocked: np.ndarray) -> GoalWave:
    wave, goals = GoalWave(1, SETTINGS), np.array([goal], np.float32)
    wave.spread(np.array([0]), wave.low_cells(np.array([0]), HERE), blocked, goals)
    return wave


def at(wave: GoalWave, x: float, z: float) -> float:
    return float(wave.at(np.array([[[x, z]]], np.float32))[0, 0])


def wall_at_x(x_m: float, low_z_m: float, high_z_m: float) -> np.ndarray:
    """A wall one cell thick along z."""
    blocked = np.zeros(WINDOW, bool)
    rows, columns = (
        np.floor(np.array(v) / SETTINGS.cell_m).astype(int) + 24 for v in ((low_z_m, high_z_m), x_m)
    )
    blocked[0, rows[0] : rows[1], columns] = True
    return blocked


@pytest.mark.parametrize("goal", [(2.0, 0.0), (-1.0, 3.0), (14.0, -9.0)])
def test_distance_over_open_floor_is_nearly_straight(goal: tuple[float, float]) -> None:
    wave = spread(goal, np.zeros(WINDOW, bool))
    for place in ((0.0, 0.0), (1.5, -2.0), (-3.0, 1.0)):
        straight = np.hypot(place[0] - goal[0], place[1] - goal[1])
        assert straight - 0.3 < at(wave, *place) < 1.09 * straight + 0.3


def test_wall_makes_a_detour() -> None:
    wave = spread((2.0, 0.1), wall_at_x(1.0, -4.0, 1.0))
    detour = np.hypot(1.0, 1.0) + np.hypot(1.0, 1.0)
    assert at(wave, 0.1, 0.1) == pytest.approx(detour, rel=0.2)
    assert at(wave, 1.9, 0.1) < 0.4


def test_wave_does_not_slip_between_cells_that_touch_at_a_corner() -> None:
    blocked = np.zeros(WINDOW, bool)
    cells = np.arange(48)
    blocked[0, cells, cells] = True
    wave = spread((1.1, -1.1), blocked)
    through = SETTINGS.blocked_cost * SETTINGS.cell_m
    assert at(wave, -0.7, 0.7) > through
    assert at(wave, 1.5, -0.7) < 1.0


def test_places_outside_of_the_window_are_as_far_as_the_crow_flies() -> None:
    wave = spread((30.0, 40.0), np.zeros(WINDOW, bool))
    assert at(wave, -30.0, -40.0) == pytest.approx(100.0, rel=1e-5)


def test_waves_take_turns_and_a_new_goal_comes_first() -> None:
    wave, goals = GoalWave(4, SETTINGS), np.ones((4, 2), np.float32)
    everyone = wave.due(goals)
    assert everyone.tolist() == [0, 1, 2, 3]
    low = wave.low_cells(everyone, np.zeros((4, 2), np.float32))
    wave.spread(everyone, low, np.zeros((4, 48, 48), bool), goals)
    assert [wave.due(goals).tolist() for _ in range(4)] == [[], [], [], [0, 1, 2, 3]]
    goals[2] += 1.0
    wave.spread(everyone, low, np.zeros((4, 48, 48), bool), np.ones((4, 2), np.float32))
    assert wave.due(goals).tolist() == [2]


def test_wave_that_would_come_out_the_same_is_not_spread_again(monkeypatch: pytest.MonkeyPatch) -> None:
    spread = [0]

    def count_wave(seeds_m: np.ndarray, price_m: np.ndarray) -> np.ndarray:
        spread[0] += 1
        return spread_wave(seeds_m, price_m)

    monkeypatch.setattr("agents.goal_wave.spread_wave", count_wave)
    wave, both = GoalWave(2, SETTINGS), np.arange(2)
    goals, blocked = np.ones((2, 2), np.float32), np.zeros((2, 48, 48), bool)
    low = wave.low_cells(both, np.zeros((2, 2), np.float32))
    moved = low + np.array([[1], [0]])
    wall = np.stack([blocked[0], ~blocked[1]])
    counts = []
    for corners, known, where in (
        (low, blocked, goals),
        (low, blocked, goals + 0.001),
        (low, wall, goals),
        (moved, wall, goals),
        (moved, wall, goals + 0.05),
    ):
        wave.spread(both, corners, known, where.astype(np.float32))
        counts.append(spread[0])
    wave.forget(1)
    wave.spread(both, moved, wall, goals + 0.05)
    assert [*counts, spread[0]] == [2, 2, 3, 4, 6, 7]


def test_window_stays_until_the_agent_is_far_from_its_middle_or_begins_anew() -> None:
    wave, one = GoalWave(1, SETTINGS), np.array([0])
    low = wave.low_cells(one, HERE)
    wave.spread(one, low, np.zeros(WINDOW, bool), np.ones((1, 2), np.float32))
    few_cells = SETTINGS.cell_m * (SETTINGS.window_cells // DRIFT_SHARE)
    assert wave.low_cells(one, HERE + np.float32(few_cells)).tolist() == low.tolist()
    assert wave.low_cells(one, HERE + np.float32(few_cells + 0.3)).tolist() != low.tolist()
    wave.forget(0)
    assert wave.low_cells(one, HERE + np.float32(few_cells)).tolist() != low.tolist()


def test_waves_that_are_kept_stay_with_their_agents(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that none is spread again."""
    wave, three = GoalWave(3, SETTINGS), np.arange(3)
    goals = np.array([[2.0, 0.1], [-2.0, 0.1], [0.1, 2.0]], np.float32)
    blocked = np.concatenate([wall_at_x(1.0, -4.0, 1.0), np.zeros(WINDOW, bool), wall_at_x(1.0, -1.0, 4.0)])
    low = wave.low_cells(three, np.zeros((3, 2), np.float32))
    wave.spread(three, low, blocked, goals)
    points = np.zeros((3, 1, 2), np.float32)
    before = wave.at(points)
    kept = np.array([2, 0])
    np.testing.assert_array_equal(wave.at(points[kept], kept), before[kept])
    wave.keep(kept)
    np.testing.assert_array_equal(wave.at(points[kept]), before[kept])
    np.testing.assert_array_equal(wave.goals_of(np.arange(2)), goals[kept])
    monkeypatch.setattr("agents.goal_wave.spread_wave", None)
    wave.spread(np.arange(2), low[kept], blocked[kept], goals[kept])


def test_maps_show_the_way_round_a_wall_that_was_seen() -> None:
    """A wall 1 m ahead on the left half of the view, the goal behind it: the way leads to the right."""
    camera = CameraSpec(width_px=32, height_px=32)
    memory, pose = EgoMemory(1, camera), camera_pose((0.0, 1.25, 0.0), 0.0)[None].astype(np.float32)
    image = np.full((1, 32, 32), 6.0, np.float32)
    image[:, :, :17] = 1.0
    one = np.ones(1, np.float32)
    memory.update(image, pose, 1.25 * one, np.array([Action.TURN_LEFT]), 0.25 * one)
    goal = np.array([[-0.3, -2.5]], np.float32)
    near = memory.waves(pose, goal)[0, 0].astype(int)
    size = EgoMemorySettings().crop_cells
    assert near[8:14, size // 2 + 4].mean() > near[8:14, size // 2 - 6].mean()


def test_at_work_a_wall_is_gone_round_where_training_went_through() -> None:
    wall, goals = wall_at_x(1.0, -4.0, 4.0), np.array([[2.0, 0.0]], np.float32)
    training, work = NavigatorNetSettings().memory.wave, NavigatorNetSettings().at_work().memory.wave
    distances_m = []
    for settings in (training, replace(work, window_cells=training.window_cells)):
        wave = GoalWave(1, settings)
        wave.spread(np.array([0]), wave.low_cells(np.array([0]), HERE), wall, goals)
        distances_m.append(at(wave, 0.1, 0.1))
    through_m, round_m = 2.0 + training.blocked_cost * training.cell_m, 2.0 * np.hypot(1.0, 4.0)
    np.testing.assert_allclose(distances_m, [through_m, round_m], rtol=0.15)
