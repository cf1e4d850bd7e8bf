"""Many agents at once do what each does alone."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from anm_gym.envs.pointnav_vector import PointNavVectorEnv
from anm_gym.errors import EpisodeError

CAMERA = {"width_px": 24, "height_px": 16}


def settings_of(scene: str, **more: Any) -> dict[str, Any]:
    return {"scene": scene, "scene_options": {"up_axis": "y"}, "camera": CAMERA, **more}


def assert_equal(first: dict[str, Any], second: dict[str, Any]) -> None:
    assert first.keys() == second.keys()
    for key, value in first.items():
        np.testing.assert_array_equal(value, second[key], err_msg=key)


@pytest.mark.parametrize("noise", [None, {"depth_std_fraction": 0.01, "forward_std_m": 0.01}])
def test_vector_form_is_bit_equal_to_single_environments(
    rooms: str, noise: Any, rng: np.random.Generator
) -> None:
    settings = settings_of(rooms, noise=noise)
    single = gymnasium.make_vec(
        "anm_gym:ANM/PointNav-v0", num_envs=3, vectorization_mode="sync", max_episode_steps=12, **settings
    )
    together = gymnasium.make_vec(
        "anm_gym:ANM/PointNav-v0",
        num_envs=3,
        vectorization_mode="vector_entry_point",
        max_episode_steps=12,
        **settings,
    )
    (expected, expected_info), (observed, info) = single.reset(seed=5), together.reset(seed=5)
    assert_equal(expected, observed)
    assert_equal(expected_info, info)
    ends = 0
    for _ in range(40):
        actions = rng.choice(4, size=3, p=[0.05, 0.55, 0.2, 0.2])
        *expected_parts, expected_info = single.step(actions)
        *parts, info = together.step(actions)
        assert_equal(expected_parts[0], parts[0])
        for expected_part, part in zip(expected_parts[1:], parts[1:], strict=True):
            np.testing.assert_array_equal(expected_part, part)
        assert_equal(expected_info, info)
        ends += int(parts[2].sum() + parts[3].sum())
    assert ends > 3


def test_agents_are_handed_the_scenes_in_turn(room: str, rooms: str) -> None:
    envs = PointNavVectorEnv(3, scenes=[room, rooms], **settings_of(room)).envs
    assert [env.scene.name for env in envs] == ["room", "rooms", "room"]
    assert envs[0].simulator.camera is envs[2].simulator.camera
    assert envs[0].simulator is not envs[2].simulator


def test_text_instead_of_a_list_of_scenes_is_an_error(rooms: str) -> None:
    with pytest.raises(TypeError, match=r"`scenes` must be a list of names, got 'home:studio:1'; write \["):
        PointNavVectorEnv(2, scenes="home:studio:1", camera=CAMERA)


def test_step_limit_is_the_registered_one_unless_given(rooms: str) -> None:
    registered = gymnasium.spec("ANM/PointNav-v0").max_episode_steps
    assert registered is not None
    turn = np.array([2])
    for given, length in (
        ({}, registered),
        ({"max_episode_steps": 3}, 3),
        ({"max_episode_steps": None}, None),
        ({"max_episode_steps": -1}, None),
    ):
        envs = PointNavVectorEnv(**settings_of(rooms, camera={"width_px": 2, "height_px": 2}), **given)
        envs.reset(seed=0)
        steps = next((step for step in range(1, registered + 2) if envs.step(turn)[3][0]), None)
        assert steps == length


def test_wrong_number_of_agents_actions_or_seeds_is_an_error(rooms: str) -> None:
    with pytest.raises(ValueError, match="`num_envs` must be >= 1, got 0"):
        PointNavVectorEnv(0, **settings_of(rooms))
    envs = PointNavVectorEnv(2, **settings_of(rooms))
    with pytest.raises(ValueError, match="`seed` must have 2 numbers, got 1"):
        envs.reset(seed=[1])
    envs.reset(seed=[1, None])
    with pytest.raises(ValueError, match=r"`actions` must have shape \(2,\), got \(3,\)"):
        envs.step(np.zeros(3, np.int64))


def test_senseless_step_limit_is_an_error(rooms: str) -> None:
    with pytest.raises(ValueError, match="`max_episode_steps` must be >= 1, or -1 for no limit, got 0"):
        PointNavVectorEnv(2, max_episode_steps=0, **settings_of(rooms))


def test_agents_are_as_strict_as_one_alone(rooms: str) -> None:
    envs = PointNavVectorEnv(2, **settings_of(rooms))
    with pytest.raises(gymnasium.error.ResetNeeded, match="no episode has begun"):
        envs.step(np.array([1, 1]))
    envs.reset(seed=0)
    for wrong in (np.array([1, 7]), np.array([1.0, 2.9])):
        with pytest.raises(ValueError, match=r"`action` must be one of \[0, 1, 2, 3\]"):
            envs.step(wrong)
    with pytest.raises(EpisodeError):
        envs.reset(options={"start": (99.0, 99.0, 0.0)})
    with pytest.raises(gymnasium.error.ResetNeeded, match="no episode has begun"):
        envs.step(np.array([1, 1]))


def test_pictures_are_drawn_for_every_agent(rooms: str) -> None:
    envs = PointNavVectorEnv(2, render_mode="depth_array", **settings_of(rooms))
    envs.reset(seed=0)
    pictures = envs.render()
    assert pictures is not None
    assert [picture.shape for picture in pictures] == [(16, 24), (16, 24)]


def test_attributes_are_read_and_set_as_in_gymnasium_s_own_vectors(rooms: str) -> None:
    envs = [
        gymnasium.make_vec(
            "anm_gym:ANM/PointNav-v0", num_envs=2, vectorization_mode=mode, **settings_of(rooms)
        )
        for mode in ("sync", "vector_entry_point")
    ]
    read = []
    for env in envs:
        env.reset(seed=3)
        env.set_attr("label", ["a", "b"])
        goals = [np.asarray(goal).tolist() for goal in env.get_attr("goal_xz")]
        called = env.call("action_of", 1), env.get_attr("close")
        read.append((goals, env.get_attr("label"), env.call("path_length_m"), called))
        with pytest.raises(ValueError, match=r"`?[Vv]alues`?"):
            env.set_attr("label", ["a", "b", "c"])
    assert read[0] == read[1]
