"""The picture of a moment: one size for all, nothing drawn twice, fog where nothing has been seen."""

from collections.abc import Callable

import numpy as np
import pytest

from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.envs.picture import HEIGHT_PX, WIDTH_PX
from anm_gym.envs.pointnav import PointNavEnv


@pytest.mark.parametrize("size_px", [(16, 16), (64, 48), (48, 64), (300, 20), (1, 1)])
def test_picture_has_one_size_for_all_cameras(
    explore: Callable[..., ExploreEnv], size_px: tuple[int, int]
) -> None:
    camera = dict(zip(("width_px", "height_px"), size_px, strict=True))
    env = explore(camera=camera, render_mode="rgb_array")
    env.reset(seed=0)
    picture = env.render()
    assert picture.shape == (HEIGHT_PX, WIDTH_PX, 3)
    assert picture.dtype == np.uint8


def test_pictures_of_one_moment_are_equal_and_apart(explore: Callable[..., ExploreEnv]) -> None:
    env = explore(render_mode="rgb_array")
    env.reset(seed=0)
    env.step(Action.MOVE_FORWARD)
    first, second = env.render(), env.render()
    np.testing.assert_array_equal(first, second)
    assert not np.shares_memory(first, second)


def test_drawing_does_not_change_the_episode(explore: Callable[..., ExploreEnv]) -> None:
    depths = []
    for is_drawn in (True, False):
        env = explore(render_mode="rgb_array", noise={"depth_std_fraction": 0.1})
        env.reset(seed=0)
        if is_drawn:
            env.render()
        depths.append(env.step(Action.TURN_LEFT)[0]["depth"])
    np.testing.assert_array_equal(*depths)


def test_fog_lifts_from_what_is_seen(explore: Callable[..., ExploreEnv]) -> None:
    """Looking at one half of the room leaves the other half pale."""
    env = explore(start=(0.0, 0.0, 0.0), render_mode="rgb_array", camera={"width_px": 64, "height_px": 64})
    env.reset(seed=0)
    picture = env.render().astype(int)
    plan = picture[:, : WIDTH_PX // 2 + 60]
    colorfulness = np.ptp(plan, axis=2)
    ahead, behind = colorfulness[120:180, 280:320].mean(), colorfulness[360:420, 280:320].mean()
    assert ahead > behind + 10.0


def test_goal_is_drawn(pointnav: Callable[..., PointNavEnv]) -> None:
    env = pointnav(render_mode="rgb_array")
    env.reset(seed=0, options={"start": (1.0, 0.0, 0.0), "goal": (3.0, 1.0)})
    far = env.render()
    env.reset(seed=0, options={"start": (1.0, 0.0, 0.0), "goal": (3.0, -1.0)})
    assert (far != env.render()).any(axis=2).sum() > 100
