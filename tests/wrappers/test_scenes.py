"""Which scene an episode is played in."""

import gymnasium
import numpy as np
import pytest

from anm_gym.wrappers.scenes import ScenesWrapper

HOMES = ["home:studio:1", "home:studio:2", "home:studio:3"]


def make(scenes=HOMES, **settings) -> ScenesWrapper:
    camera = {"width_px": 8, "height_px": 8}
    env = gymnasium.make("anm_gym:ANM/Explore-v0", scene="home:studio:0", camera=camera)
    return ScenesWrapper(env, scenes=scenes, **settings)


def played(env: ScenesWrapper, count: int, seed: int) -> list[str]:
    """Names of the scenes of some episodes."""
    names = []
    for index in range(count):
        env.reset(seed=seed if index == 0 else None)
        names.append(env.get_wrapper_attr("scene").name)
    return names


def test_scenes_of_the_list_are_drawn_by_the_seed() -> None:
    env = make()
    first = played(env, 12, seed=1)
    assert set(first) == set(HOMES)
    assert played(env, 12, seed=1) == first
    assert played(env, 12, seed=5) != first


def test_scene_stays_for_some_episodes_and_a_seed_draws_anew() -> None:
    env = make(episodes_each=3)
    names = played(env, 9, seed=1)
    assert all(len(set(names[index : index + 3])) == 1 for index in (0, 3, 6))
    assert len(set(names)) > 1
    assert played(env, 1, seed=1) == names[:1]


def test_scene_that_is_asked_for_goes_first() -> None:
    env = make()
    env.reset(seed=0, options={"scene": "home:studio:0"})
    assert env.get_wrapper_attr("scene").name == "home:studio:0"


def test_options_are_handed_on() -> None:
    env = make(scenes=HOMES[:1])
    env.reset(seed=0)
    x, z = env.unwrapped.simulator.state.position_xz.tolist()
    env.reset(options={"start": (x, z, 0.5)})
    assert env.unwrapped.simulator.state.heading_rad == 0.5


def test_scene_says_nothing_of_where_the_episode_starts() -> None:
    """A seed draws both; were they drawn from one stream, each home would be entered at one end only."""
    env = make(scenes=HOMES[:2])
    drawn = [played(env, 1, seed)[0] for seed in range(60)]
    one_stream = [HOMES[np.random.default_rng(seed).integers(2)] for seed in range(60)]
    assert 0.2 < np.mean([ours == theirs for ours, theirs in zip(drawn, one_stream, strict=True)]) < 0.8


def test_text_instead_of_a_list_is_an_error() -> None:
    with pytest.raises(TypeError, match="`scenes` must be a list of names, got 'home:studio:1'"):
        make(scenes="home:studio:1")


@pytest.mark.parametrize("settings", [{"scenes": []}, {"episodes_each": 0}])
def test_nothing_to_draw_is_refused(settings) -> None:
    with pytest.raises(ValueError, match="`scenes` must name at least one and `episodes_each` must be >= 1"):
        make(**settings)
