"""What a navigator need not try, and when it may again."""

import numpy as np

from agents.reflexes import Reflexes
from anm_gym.actions import Action
from anm_gym.geometry import camera_pose

FORWARD, STOP = int(Action.MOVE_FORWARD), int(Action.STOP)
FAR, NEAR = np.array([3.0]), np.array([0.19])


def pose(x: float, z: float, heading_rad: float) -> np.ndarray:
    return camera_pose((x, 1.0, z), heading_rad)[None].astype(np.float32)


def test_stop_is_worth_a_try_only_where_it_succeeds() -> None:
    reflexes = Reflexes(2)
    allowed = reflexes.allowed(pose(0, 0, 0).repeat(2, axis=0), np.array([0.21, 0.19]))
    assert allowed[:, STOP].tolist() == [False, True]
    assert allowed[:, [1, 2, 3]].all()


def test_heading_that_was_blocked_is_not_tried_again_before_the_agent_has_moved() -> None:
    reflexes = Reflexes(1)
    steps = [(0.0, 0.0, Action.STOP), (0.0, 0.0, Action.MOVE_FORWARD), (0.0, 0.5, Action.TURN_LEFT)]
    allowed = []
    for x, heading_rad, previous in [*steps, (0.0, 0.0, Action.TURN_RIGHT), (0.1, 0.0, Action.MOVE_FORWARD)]:
        here = pose(x, 0.0, heading_rad)
        reflexes.update(here, np.array([int(previous)]))
        allowed.append(bool(reflexes.allowed(here, FAR)[0, FORWARD]))
    assert allowed == [True, False, True, False, True]


def test_heading_is_known_again_across_the_half_turn() -> None:
    reflexes = Reflexes(1)
    for heading_rad in (np.pi - 0.01, np.pi - 0.01):
        reflexes.update(pose(0, 0, heading_rad), np.array([FORWARD]))
    assert not reflexes.allowed(pose(0, 0, -np.pi + 0.01), NEAR)[0, FORWARD]


def test_new_episode_forgets() -> None:
    reflexes = Reflexes(1)
    for _ in range(2):
        reflexes.update(pose(0, 0, 0), np.array([FORWARD]))
    assert not reflexes.allowed(pose(0, 0, 0), FAR)[0, FORWARD]
    reflexes.begin(0)
    assert reflexes.allowed(pose(0, 0, 0), FAR)[0, FORWARD]
