from dataclasses import replace

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from agents.layout_memory import EXPLORED, OCCUPIED, LayoutSettings
from agents.occant_model import OccAntSettings
from train.occant.twin import REWARD_PER_M2, OccAntTwinEnv, TwinEyes, TwinSettings
from train.occant.twin_world import TwinWorld

LAYOUT = LayoutSettings(map_cells=160, view_cells=16, pool=4)
SETTINGS = TwinSettings(LAYOUT, OccAntSettings().projection, goals=3)


def env_of(world: TwinWorld, reward: str = "area_seen", anticipator=None) -> OccAntTwinEnv:
    return OccAntTwinEnv([world], replace(SETTINGS, reward=reward), anticipator)


def all_known(patches: np.ndarray) -> np.ndarray:
    """Anticipate that everything is free."""
    return np.stack([np.zeros_like(patches[:, 0]), np.ones_like(patches[:, 1])], axis=1)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_twin_is_a_gymnasium_environment(twin_rooms: TwinWorld) -> None:
    check_env(env_of(twin_rooms), skip_render_check=True)


def test_same_seed_replays_the_same_episode(twin_rooms: TwinWorld) -> None:
    env, episodes = env_of(twin_rooms), []
    for _ in range(2):
        env.reset(seed=3)
        episodes.append([env.step(np.int64(goal))[1] for goal in (10, 200, 77)])
    assert episodes[0] == episodes[1]


def test_episode_has_as_many_goals_as_the_settings_say(twin_rooms: TwinWorld) -> None:
    env = env_of(twin_rooms)
    env.reset(seed=0)
    assert [env.step(np.int64(0))[3] for _ in range(3)] == [False, False, True]


def test_reward_pays_the_newly_seen_layout(twin_rooms: TwinWorld) -> None:
    env = env_of(twin_rooms)
    _, info = env.reset(seed=0)
    before_m2, rewards = info["seen_m2"], 0.0
    for goal in (0, 255, 128):
        _, reward, _, _, info = env.step(np.int64(goal))
        assert reward >= 0.0
        rewards += reward
    assert rewards == pytest.approx(REWARD_PER_M2 * (info["seen_m2"] - before_m2))
    assert 0.0 < info["seen_share"] <= 1.0
    assert info["seen_share"] == pytest.approx(info["seen_m2"] / twin_rooms.layout_m2)


def test_right_anticipation_is_paid_and_wrong_is_not(twin_rooms: TwinWorld) -> None:
    env = env_of(twin_rooms, "map_accuracy", all_known)
    _, info = env.reset(seed=0)
    known = env.memory.grid.is_known.sum() * LAYOUT.cell_m**2
    # All free is right on the floor and wrong on the walls.
    assert 0.0 < info["accurate_m2"] < min(known, (twin_rooms.layout & (twin_rooms.top_m == 0)).sum() * 0.01)
    visible = env_of(twin_rooms, "map_accuracy").reset(seed=0)[1]
    assert info["accurate_m2"] > visible["accurate_m2"]


def test_map_without_anticipation_agrees_with_the_world(twin_rooms: TwinWorld) -> None:
    env = env_of(twin_rooms, "map_accuracy")
    env.reset(seed=1)
    for goal in (0, 255, 15):
        _, _, _, _, info = env.step(np.int64(goal))
    assert info["accurate_m2"] > 0.75 * info["seen_m2"]


def test_look_shows_the_wall_ahead_on_the_patch(twin_rooms: TwinWorld) -> None:
    look = TwinEyes(SETTINGS).look(twin_rooms, np.array([[1.5, 2.6, 0.0]]))[0]
    # The wall's near side is at z = 0.1, 2.5 m ahead: 25 rows up from the last.
    rows = np.flatnonzero(look[OCCUPIED][:, 32])
    assert rows.max() in {64 - 25, 64 - 26}
    assert look[EXPLORED][64 - 20, 32]
    assert not look[EXPLORED][64 - 30 :: -1, 32].any()


def test_world_can_be_chosen_and_must_exist(twin_rooms: TwinWorld) -> None:
    env = OccAntTwinEnv([twin_rooms, replace(twin_rooms, name="other")], SETTINGS)
    env.reset(seed=0, options={"world": 1})
    assert env.world.name == "other"
    with pytest.raises(ValueError, match="`worlds` must hold at least one world, got none"):
        OccAntTwinEnv([], SETTINGS)
