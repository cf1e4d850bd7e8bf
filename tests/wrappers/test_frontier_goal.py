from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.envs.mesh_env import Observation
from anm_gym.mesh import TriangleMesh
from anm_gym.sim.grid import GridFrame
from anm_gym.wrappers.frontier_goal import PRESETS, FrontierGoalWrapper
from anm_gym.wrappers.goal import GoalWrapper

Explore = Callable[..., ExploreEnv]
IN_THE_LEFT_ROOM = (-2.0, 0.0, np.pi / 2)
"""Start in the left room with the door behind."""


STRAIGHT_AWAY = {
    name: replace(settings, sweeps=False)
    for name, settings in PRESETS.items()
    if settings.map_source == "observed"
}
"""The presets for the wrapper's own map, without the turn at the start."""


def turn_round(env: FrontierGoalWrapper) -> None:
    for _ in range(36):
        env.step(np.int64(Action.TURN_LEFT))


@pytest.mark.parametrize("preset", sorted(STRAIGHT_AWAY))
def test_first_goal_is_where_the_seen_floor_ends(
    explore: Explore, two_rooms: TriangleMesh, preset: str
) -> None:
    env = FrontierGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM), settings=STRAIGHT_AWAY[preset])
    env.reset(seed=0)
    assert env.goal.reason == "frontier"
    row, column = env.occupancy.frame.cells_of(env.goal.position_xz)[0]
    assert env.occupancy.free[row, column]
    assert env.occupancy.unknown[row - 1 : row + 2, column - 1 : column + 2].any()


def test_after_a_turn_the_frontier_is_in_the_next_room(explore: Explore, two_rooms: TriangleMesh) -> None:
    env = FrontierGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM))
    env.reset(seed=0)
    turn_round(env)
    assert env.goal.position_xz[0] > 0.0
    assert env.goal.heading_rad is not None


def test_paper_preset_goes_at_least_a_metre(explore: Explore, two_rooms: TriangleMesh) -> None:
    env = FrontierGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM), preset="paper")
    env.reset(seed=0)
    assert np.linalg.norm(env.goal.position_xz - IN_THE_LEFT_ROOM[:2]) >= 1.0
    assert env.goal.heading_rad is None


def test_room_without_frontier_is_wandered_through(
    explore: Explore, box_room: Callable[..., TriangleMesh]
) -> None:
    env = FrontierGoalWrapper(explore(box_room(), start=(0.0, 0.0, 0.0)))
    env.reset(seed=0)
    turn_round(env)
    assert env.goal.reason == "wander"


def test_frontier_that_failed_is_not_proposed_again_by_the_strong_preset(
    explore: Explore, two_rooms: TriangleMesh
) -> None:
    env = FrontierGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM), settings=STRAIGHT_AWAY["strong"])
    env.reset(seed=0)
    failed = env.goal.position_xz
    env.report_unreachable("no way")
    assert np.linalg.norm(env.goal.position_xz - failed) >= 0.5


def test_paper_preset_has_no_memory_of_failures(explore: Explore, two_rooms: TriangleMesh) -> None:
    env = FrontierGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM), preset="paper")
    env.reset(seed=0)
    failed = env.goal.position_xz
    env.report_unreachable("no way")
    assert env.goal.position_xz == pytest.approx(failed)


def test_sweep_turns_once_round_before_anything_else(explore: Explore, two_rooms: TriangleMesh) -> None:
    env = FrontierGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM))
    env.reset(seed=0)
    assert env.goal.reason == "sweep"
    turn_round(env)
    assert [goal.reason for goal in env.goals[:4]] == ["sweep", "sweep", "sweep", "frontier"]


def test_goal_under_way_is_kept_until_another_is_clearly_nearer(
    explore: Explore, two_rooms: TriangleMesh
) -> None:
    env = FrontierGoalWrapper(explore(two_rooms, start=(-2.0, 0.0, -np.pi / 2)))
    env.reset(seed=0)
    turn_round(env)
    chosen = env.goal
    for action in (Action.TURN_LEFT, Action.TURN_RIGHT) * 10:
        env.step(np.int64(action))
    assert env.goal is chosen


class EastIsFree:
    """A map of one's own: a strip of free floor from the agent to the east, whatever is seen."""

    identity = None

    def begin(self, env: GoalWrapper) -> None:
        self.episodes, self.frames = getattr(self, "episodes", 0) + 1, 0
        x, z = env.position_xz
        self.frame = GridFrame((float(x) - 2.05, float(z) - 2.05), 0.1, (41, 81))

    def see(self, observation: Observation) -> None:
        self.frames += 1

    def floor(self) -> tuple[GridFrame, NDArray[np.bool_], NDArray[np.bool_]]:
        free = np.zeros(self.frame.shape, bool)
        free[18:23, 20:60] = True
        unknown = np.zeros(self.frame.shape, bool)
        unknown[:, 60:] = True
        return self.frame, free, unknown


PREDICTED = PRESETS["upen-repo"]


def test_frontiers_of_another_map_take_the_place_of_the_own_ones(
    explore: Explore, two_rooms: TriangleMesh
) -> None:
    source = EastIsFree()
    env = FrontierGoalWrapper(explore(two_rooms, start=IN_THE_LEFT_ROOM), settings=PREDICTED, source=source)
    env.reset(seed=0)
    env.step(np.int64(Action.TURN_LEFT))
    assert (source.episodes, source.frames) == (1, 2)
    assert env.goal.reason == "frontier"
    assert env.goal.position_xz == pytest.approx((-2.0 + 3.9, 0.0), abs=0.06)


def test_source_and_map_source_go_together(explore: Explore, two_rooms: TriangleMesh) -> None:
    message = "`source` must be given for a predicted map and for no other, got"
    with pytest.raises(ValueError, match=message):
        FrontierGoalWrapper(explore(two_rooms), preset="upen-repo")
    with pytest.raises(ValueError, match=message):
        FrontierGoalWrapper(explore(two_rooms), source=EastIsFree())


def test_ways_are_only_known_in_the_own_map() -> None:
    with pytest.raises(ValueError, match="`only_reachable` must be False with `map_source` predicted"):
        replace(PREDICTED, only_reachable=True)


def test_unknown_preset_lists_the_choices(explore: Explore, two_rooms: TriangleMesh) -> None:
    with pytest.raises(ValueError, match="unknown frontier preset 'weak'; choose one of: paper, strong"):
        FrontierGoalWrapper(explore(two_rooms), preset="weak")
