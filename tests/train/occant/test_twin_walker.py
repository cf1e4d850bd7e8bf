import numpy as np
import pytest

from anm_gym.actions import FORWARD_STEP_M
from train.occant.twin_walker import TwinWalker, WalkSettings
from train.occant.twin_world import TwinWorld


@pytest.fixture
def walker(twin_rooms: TwinWorld) -> TwinWalker:
    """Give a walker in the left room that looks along +x at the door."""
    return TwinWalker(twin_rooms, np.array([1.0, 1.55, -np.pi / 2]), WalkSettings())


def all_seen(walker: TwinWalker) -> np.ndarray:
    return np.ones(walker.world.frame.shape, bool)


def test_agent_walks_straight_ahead_in_steps_of_the_simulator(walker: TwinWalker) -> None:
    poses = walker.walk(np.array([5.0, 1.55]), all_seen(walker), 10)
    assert poses[:, 0] == pytest.approx(1.0 + FORWARD_STEP_M * np.arange(1, 11))
    assert poses[:, 1] == pytest.approx(1.55)


def test_way_across_a_room_needs_no_turns_on_the_way(walker: TwinWalker) -> None:
    walker.pose[:] = [0.5, 2.5, -np.pi / 4]
    poses = walker.walk(np.array([2.5, 0.7]), all_seen(walker), 35)
    is_walking = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1) > 0.0
    assert is_walking.mean() > 0.85


def test_agent_turns_by_ten_degrees_before_it_walks(walker: TwinWalker) -> None:
    poses = walker.walk(np.array([0.4, 1.55]), all_seen(walker), 20)
    turns = np.unwrap(poses[:, 2])
    assert abs(np.diff(turns)[:15]) == pytest.approx(np.deg2rad(10.0))
    assert poses[16, :2] == pytest.approx([1.0, 1.55])
    assert poses[-1, 0] < 1.0


def test_agent_goes_through_the_door_to_the_other_room(walker: TwinWalker) -> None:
    poses = walker.walk(np.array([4.5, 0.5]), all_seen(walker), 90)
    assert np.linalg.norm(poses[-1, :2] - (4.5, 0.5)) < 0.35
    assert all(walker.world.is_navigable(pose[:2]) for pose in poses)


def test_agent_turns_on_the_spot_once_it_has_arrived(walker: TwinWalker) -> None:
    poses = walker.walk(np.array([1.1, 1.55]), all_seen(walker), 36)
    assert poses[:, :2] == pytest.approx(np.tile([1.0, 1.55], (36, 1)))
    assert len(np.unique(np.round(poses[:, 2], 6))) == 36


def test_unseen_wall_is_touched_and_then_known(walker: TwinWalker) -> None:
    walker.pose[:] = [2.0, 0.5, -np.pi / 2]
    walker.walk(np.array([5.0, 0.5]), np.zeros(walker.world.frame.shape, bool), 25)
    assert walker.touched.any()
    assert walker.touched.nonzero()[1].min() >= 29
    assert walker.pose[0] < 3.0


def test_goal_beyond_the_world_is_approached(walker: TwinWalker) -> None:
    walker.walk(np.array([30.0, 1.55]), all_seen(walker), 70)
    assert walker.pose[0] > 5.0
