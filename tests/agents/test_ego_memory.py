"""The maps around an agent: what a hand-made image leaves in them, and where."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from agents.ego_memory import BLOCKED, FREE, OCCUPIED, VISITED, EgoMemory, EgoMemorySettings, lattice_offsets
from agents.goal_wave import GoalWaveSettings
from agents.way_out import WayOutSettings
from anm_gym.actions import Action
from anm_gym.geometry import CameraSpec, camera_pose

CAMERA = CameraSpec(width_px=32, height_px=32)
HEIGHT = np.array([1.25], np.float32)
STEP = np.array([0.25], np.float32)
FORWARD, OTHER = np.array([Action.MOVE_FORWARD]), np.array([Action.TURN_LEFT])


def pose(x: float, z: float, heading_rad: float) -> np.ndarray:
    return camera_pose((x, 1.25, z), heading_rad)[None].astype(np.float32)


def wall_ahead(distance_m: float) -> np.ndarray:
    return np.full((1, 32, 32), distance_m, np.float32)


def flags_at(crop: np.ndarray, right_m: float, ahead_m: float, scale: int = 0) -> int:
    offsets = lattice_offsets(EgoMemorySettings(), scale)
    apart = np.linalg.norm(offsets - [right_m, ahead_m], axis=-1)
    return int(crop[scale][np.unravel_index(apart.argmin(), apart.shape)])


@pytest.mark.parametrize("heading_rad", [0.0, 0.7, np.pi / 2, -2.5])
@pytest.mark.parametrize("place", [(0.0, 0.0), (-31.3, 17.8)])
def test_wall_ahead_is_ahead_whatever_the_heading(heading_rad: float, place: tuple[float, float]) -> None:
    memory = EgoMemory(1, CAMERA)
    here = pose(*place, heading_rad)
    memory.update(wall_ahead(1.5), here, HEIGHT, OTHER, STEP)
    crop = memory.crops(here)[0]
    near_wall = [flags_at(crop, 0.0, ahead) for ahead in (1.4, 1.5, 1.6)]
    assert any(flags & OCCUPIED for flags in near_wall)
    between = np.array([flags_at(crop, 0.0, ahead) for ahead in np.arange(0.15, 1.25, 0.1)])
    assert (between & FREE).astype(bool).mean() > 0.7
    assert not (between & OCCUPIED).any()
    assert flags_at(crop, 0.0, 2.1) == 0
    assert flags_at(crop, 1.2, 0.1) == 0, "outside of the field of view"


def test_obstacle_on_the_left_stays_on_the_left_until_the_agent_turns_to_it() -> None:
    memory = EgoMemory(1, CAMERA)
    image = np.zeros((1, 32, 32), np.float32)
    image[:, :, :8] = 1.0
    memory.update(image, pose(0.0, 0.0, 0.0), HEIGHT, OTHER, STEP)
    left, right = (flags_at(memory.crops(pose(0.0, 0.0, 0.0))[0], side, 1.0) for side in (-0.8, 0.8))
    assert (left & OCCUPIED, right & OCCUPIED) == (OCCUPIED, 0)
    bearing_rad = np.arctan2(0.8, 1.0)
    turned = memory.crops(pose(0.0, 0.0, bearing_rad))[0]
    assert any(flags_at(turned, 0.0, ahead) & OCCUPIED for ahead in (1.2, 1.28, 1.36))


def test_floor_and_ceiling_are_no_obstacles() -> None:
    directions = CAMERA.directions
    with np.errstate(divide="ignore"):
        floor = np.where(directions[..., 1] < 0, 1.25 / -directions[..., 1], 0.0)
        ceiling = np.where(directions[..., 1] > 0, 1.25 / directions[..., 1], 0.0)
    memory = EgoMemory(1, CAMERA)
    memory.update((floor + ceiling)[None].astype(np.float32), pose(0.0, 0.0, 0.0), HEIGHT, OTHER, STEP)
    assert not (memory.crops(pose(0.0, 0.0, 0.0)) & OCCUPIED).any()


def test_cut_short_step_is_remembered_and_a_full_one_is_not() -> None:
    memory = EgoMemory(1, CAMERA)
    for z, action in ((0.0, OTHER), (-0.25, FORWARD), (-0.30, FORWARD)):
        memory.update(wall_ahead(0.0), pose(0.05, z, 0.0), HEIGHT, action, STEP)
        blocked = (memory.crops(pose(0.05, z, 0.0)) & BLOCKED).any()
        assert bool(blocked) is (z == -0.30)
    crop = memory.crops(pose(0.05, -0.30, 0.0))[0]
    assert (crop[0, 20:24, 15:17] & VISITED).any(), "where the agent stands"


def test_agents_have_memories_of_their_own_and_can_forget() -> None:
    memory = EgoMemory(2, CAMERA)
    both = np.concatenate([pose(0.0, 0.0, 0.0)] * 2)
    images = np.concatenate([wall_ahead(1.0), wall_ahead(0.0)])
    memory.update(images, both, HEIGHT.repeat(2), OTHER.repeat(2), STEP.repeat(2))
    first, second = memory.crops(both)
    assert (first & OCCUPIED).any()
    assert not (second & OCCUPIED).any()
    memory.reset(0)
    assert not memory.crops(both)[0].any()
    assert memory.crops(both)[1].any()


def test_every_map_says_how_much_of_it_lies_behind() -> None:
    with pytest.raises(ValueError, match="`behind_share` must have one number for each of 2 maps"):
        EgoMemorySettings(behind_share=(0.3,))


@pytest.mark.parametrize("grid_cells", [200, 128])
def test_grid_that_windows_do_not_fit_on_is_refused(grid_cells: int) -> None:
    with pytest.raises(
        ValueError, match=f"power of two and at least 192, the widest window, got {grid_cells}"
    ):
        EgoMemorySettings(grid_cells=grid_cells)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: GoalWaveSettings(cell_m=0.0), "`cell_m` must be > 0, got 0.0"),
        (lambda: GoalWaveSettings(every_steps=0), "`every_steps` must be >= 1, got 0"),
        (lambda: GoalWaveSettings(window_cells=0), "`window_cells` must be >= 2, got 0"),
        (lambda: WayOutSettings(contact_cost=0.0), "`contact_cost` must be > 0, got 0.0"),
        (lambda: EgoMemorySettings(cell_m=(0.1, 0.0)), r"`cell_m` must have numbers > 0, got \(0.1, 0.0\)"),
        (lambda: EgoMemorySettings(ray_step_m=0.0), "`ray_step_m` must be > 0, got 0.0"),
        (
            lambda: EgoMemorySettings(way_out=WayOutSettings(window_cells=10)),
            "`way_out.window_cells` must be >= 12, to hold the points ahead of an agent, got 10",
        ),
    ],
)
def test_sizes_with_which_an_agent_would_be_lost_are_refused(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_smallest_window_holds_the_points_ahead_of_an_agent() -> None:
    memory = EgoMemory(1, CAMERA, EgoMemorySettings(way_out=WayOutSettings(window_cells=12)))
    agent = np.array([0])
    for x in np.linspace(0.0, 0.1, 7):
        memory.update(wall_ahead(0.0), pose(x, x, x), HEIGHT, OTHER, STEP)
        memory.waves(pose(x, x, x), np.array([[x, x - 2.0]], np.float32))
        assert np.isfinite(memory.ahead(pose(x, x, x), agent)).all()
