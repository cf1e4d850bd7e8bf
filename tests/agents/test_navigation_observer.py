"""What networks are shown of several agents: each its own, whoever else is there."""

import numpy as np
import pytest
from numpy.typing import NDArray

from agents.navigation_observer import NavigationObserver
from agents.navigator_net import NavigatorNetSettings
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
