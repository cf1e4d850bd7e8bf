"""What networks are shown of several agents: each its own, whoever else is there."""

import numpy as np
import pytest
from numpy.typing import NDArray

from agents.ego_memory import BLOCKED
from agents.navigation_observer import NavigationObserver
from agents.navigator_net import NUM_PREVIOUS, NavigatorNetSettings
from anm_gym.actions import Action
from anm_gym.geometry import CameraSpec, camera_pose

COUNT = 4
FRAMES = 6


@pytest.fixture
def frames(rng: np.random.Generator) -> list[tuple[NDArray, NDArray, NDArray]]:
    """Give depth, poses and goals of agents that wander about before uneven walls."""
    frames = []
    for index in range(FRAMES):
        depth = rng.uniform(0.5, 4.0, (COUNT, 16, 16)).astype(np.float32)
        poses = [camera_pose((0.1 * index, 1.25, agent), 0.4 * agent * index) for agent in range(COUNT)]
        goals = np.stack([rng.uniform(1.0, 5.0, COUNT), rng.uniform(-3.0, 3.0, COUNT)], axis=1)
        frames.append((depth, np.stack(poses).astype(np.float32), goals.astype(np.float32)))
    return frames


def test_agents_that_are_kept_see_what_they_would_have_seen_among_all(frames) -> None:
    kept = [3, 1]
    everyone, some = (
        NavigationObserver(COUNT, CameraSpec(16, 16), 1.25, 0.25, NavigatorNetSettings()) for _ in range(2)
    )
    for index, (depth, poses, goals) in enumerate(frames):
        if index == FRAMES // 2:
            some.keep(kept)
        chosen = kept if index >= FRAMES // 2 else range(COUNT)
        whole = everyone.observe(depth, poses, goals)
        part = some.observe(*(values[chosen] for values in (depth, poses, goals)))
        for key, values in part.items():
            np.testing.assert_array_equal(values, whole[key][chosen], err_msg=key)
        forward = np.ones(COUNT, np.int64)
        everyone.note(forward)
        some.note(forward[chosen])


def test_lost_agents_are_led_each_its_own_way() -> None:
    """Two of three turn on the spot before the first goes home: the others go on as if they were alone."""
    settings, camera, left = NavigatorNetSettings().at_work(), CameraSpec(16, 16), int(Action.TURN_LEFT)
    together = NavigationObserver(3, camera, 1.25, 0.25, settings)
    alone = [NavigationObserver(1, camera, 1.25, 0.25, settings) for _ in range(3)]
    depth = np.full((3, 16, 16), 8.0, np.float32)
    goals = np.array([[3.0, 0.5], [3.0, -2.5], [3.0, 2.5]], np.float32)
    actions = np.array([int(Action.MOVE_FORWARD), left, left])
    for step in range(27):
        places = [(0.5 * step, 0.0, 0.0), (7.0, 0.0, 0.17 * step), (0.0, 9.0, 0.17 * step)]
        poses = np.stack([camera_pose((x, 1.25, z), turn) for x, z, turn in places]).astype(np.float32)
        together.observe(depth, poses, goals)
        together.note(actions)
        for agent, observer in enumerate(alone):
            one = np.s_[agent : agent + 1]
            observer.observe(depth[one], poses[one], goals[one])
            observer.note(actions[one])
    each = [
        observer.allowed(poses[agent : agent + 1], goals[agent : agent + 1])[0]
        for agent, observer in enumerate(alone)
    ]
    np.testing.assert_array_equal(together.allowed(poses, goals), each)
    assert [int(row.sum()) for row in each] == [3, 1, 1]
    assert not np.array_equal(each[1], each[2])
    kept = [2, 0]
    together.keep(kept)
    np.testing.assert_array_equal(together.allowed(poses[kept], goals[kept]), np.array(each)[kept])


def test_new_episode_is_seen_as_by_a_new_observer(frames) -> None:
    settings = NavigatorNetSettings()
    used, new = (NavigationObserver(COUNT, CameraSpec(16, 16), 1.25, 0.25, settings) for _ in range(2))
    for depth, poses, goals in frames:
        used.observe(depth, poses + np.float32(0.3), goals)
        used.note(np.ones(COUNT, np.int64))
    for agent in range(COUNT):
        used.begin_episode(agent)
    again, first = (observer.observe(*frames[0]) for observer in (used, new))
    for key, values in first.items():
        np.testing.assert_array_equal(again[key], values, err_msg=key)


def test_new_goal_does_not_make_a_blocked_step_forgotten() -> None:
    """The goal often changes just then: the network is shown a start, the memory what stopped the agent."""
    observer = NavigationObserver(1, CameraSpec(16, 16), 1.25, 0.25, NavigatorNetSettings())
    depth, goal = np.full((1, 16, 16), 8.0, np.float32), np.array([[3.0, 0.5]], np.float32)
    pose = camera_pose((0.0, 1.25, 0.0), 0.0)[None].astype(np.float32)
    observer.observe(depth, pose, goal)
    observer.note(np.array([int(Action.MOVE_FORWARD)]))
    observer.begin_goal(0)
    shown = observer.observe(depth, pose, goal)
    assert (shown["maps"] & BLOCKED).any()
    assert not observer.allowed(pose, goal)[0, int(Action.MOVE_FORWARD)]
    assert shown["previous_action"].tolist() == [[NUM_PREVIOUS - 1]]
    observer.note(np.array([int(Action.TURN_LEFT)]))
    assert observer.observe(depth, pose, goal)["previous_action"].tolist() == [[int(Action.TURN_LEFT)]]
