"""What both environments promise: the checkers' contract, copies, vectors, the same bits for a seed."""

import copy
import hashlib
import pickle
import re
import subprocess
import sys
import warnings
from collections.abc import Callable
from multiprocessing.reduction import ForkingPickler
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.envs.mesh_env import MeshEnv
from anm_gym.envs.pointnav import PointNavEnv
from anm_gym.errors import EpisodeError

IDS = ("ANM/Explore-v0", "ANM/PointNav-v0")
SCENE = "home:studio:0"
CAMERA = {"width_px": 24, "height_px": 16}
NOISE = {"forward_std_m": 0.01, "turn_std_deg": 2.0, "depth_std_fraction": 0.01}
ACTIONS = (1, 1, 2, 1, 1, 1, 3, 3, 1, 1, 2, 1)


def make(name: str, **settings: Any) -> MeshEnv:
    env = gymnasium.make(name, **{"scene": SCENE, "camera": CAMERA, **settings}).unwrapped
    assert isinstance(env, MeshEnv)
    return env


def sent_to_a_process(env: MeshEnv) -> MeshEnv:
    return ForkingPickler.loads(ForkingPickler.dumps(env))


def play(env: gymnasium.Env[Any, Any], seed: int, actions: tuple[int, ...] = ACTIONS) -> str:
    """Digest everything that an episode returns."""
    digest = hashlib.sha256()

    def add(observation: dict[str, np.ndarray], *rest: Any) -> None:
        for key in sorted(observation):
            digest.update(observation[key].tobytes())
        digest.update(repr(rest).encode())

    add(*env.reset(seed=seed))
    for action in actions:
        add(*env.step(action))
    return digest.hexdigest()


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("noise", [None, NOISE])
def test_gymnasium_finds_nothing_to_say(name: str, noise: dict[str, float] | None) -> None:
    env = make(name, noise=noise, render_mode="rgb_array")
    check_env(env)


@pytest.mark.parametrize("name", IDS)
def test_stable_baselines_finds_nothing_but_the_known(name: str) -> None:
    """Depth in metres needs float32, which its image policies do not take; a pose is a matrix."""
    from stable_baselines3.common.env_checker import check_env as check

    known = (
        "depth is an image but its `dtype`",
        "depth is an image but the upper and lower bounds",
        "world_from_camera has an unconventional shape",
    )
    with warnings.catch_warnings():
        for message in known:
            warnings.filterwarnings("ignore", f".*{message}", UserWarning)
        check(make(name, camera={"width_px": 36, "height_px": 36}))


@pytest.mark.parametrize("name", IDS)
def test_info_holds_plain_scalars_of_lasting_types(name: str) -> None:
    env = make(name)
    _, info = env.reset(seed=0)
    types = {key: type(value) for key, value in info.items()}
    assert set(types.values()) <= {bool, int, float}
    for action in ACTIONS:
        *_, info = env.step(action)
        assert {key: type(value) for key, value in info.items()} == types


@pytest.mark.parametrize("name", IDS)
def test_observations_share_no_memory(name: str) -> None:
    env = make(name)
    observation, _ = env.reset(seed=0)
    kept = copy.deepcopy(observation)
    after, *_ = env.step(Action.TURN_LEFT)
    for key, value in observation.items():
        assert value.flags.c_contiguous
        assert not np.shares_memory(value, after[key])
        np.testing.assert_array_equal(value, kept[key])


@pytest.mark.parametrize("name", IDS)
def test_same_seed_gives_the_same_bits_in_another_process(name: str) -> None:
    script = "\n".join(
        [
            "import sys, importlib.util",
            f"spec = importlib.util.spec_from_file_location('here', {__file__!r})",
            "here = importlib.util.module_from_spec(spec); spec.loader.exec_module(here)",
            f"print(here.play(here.make({name!r}, noise=here.NOISE), seed=5))",
        ]
    )
    other = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert play(make(name, noise=NOISE), seed=5) == other.stdout.strip()


@pytest.mark.parametrize("name", IDS)
def test_other_seeds_give_other_starts(name: str) -> None:
    env = make(name)
    assert len({play(env, seed, ()) for seed in range(5)}) == 5


@pytest.mark.parametrize("name", IDS)
def test_episode_does_not_depend_on_those_before(name: str) -> None:
    env = make(name, noise=NOISE)
    first = play(env, seed=3)
    play(env, seed=4)
    env.reset(options={"scene": "home:studio:1"})
    assert play(env, seed=3) == first


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("copied", [copy.deepcopy, sent_to_a_process])
def test_copy_goes_on_where_the_original_is(name: str, copied: Callable[[MeshEnv], MeshEnv]) -> None:
    env = make(name, noise=NOISE)
    play(env, seed=1)
    twin = copied(env)
    assert twin.scene is env.scene
    for action in ACTIONS:
        ours, theirs = env.step(action), twin.step(action)
        assert ours[1:] == theirs[1:]
        for key, value in ours[0].items():
            np.testing.assert_array_equal(value, theirs[0][key])


def test_pickle_of_an_environment_does_not_carry_the_floor() -> None:
    sizes = []
    for name in IDS:
        env = make(name)
        play(env, seed=1)
        sizes.append(len(pickle.dumps(env)))
    assert max(sizes) < 100_000, "poses and ways, no rasters"


def test_meshes_and_homes_can_be_mixed_where_meshes_take_options(room: str) -> None:
    env = ExploreEnv(room, scene_options={"up_axis": "y"}, camera={"width_px": 24, "height_px": 16})
    env.reset(seed=0, options={"scene": "home:studio:1"})
    assert env.scene.name == "home:studio:1"
    env.reset(seed=0)
    assert env.scene.name == "room"


def test_goal_before_an_episode_is_a_named_error(pointnav: Callable[..., PointNavEnv]) -> None:
    with pytest.raises(gymnasium.error.ResetNeeded, match="there is no goal yet; call `reset` first"):
        _ = pointnav().goal_xz


def test_copy_of_an_environment_that_has_not_begun_can_begin(explore: Callable[..., ExploreEnv]) -> None:
    env = explore()
    assert play(copy.deepcopy(env), seed=2) == play(env, seed=2)


@pytest.mark.parametrize(("name", "mode"), [(IDS[0], "sync"), (IDS[1], "sync"), (IDS[1], "async")])
def test_vector_of_environments_plays_the_single_ones(name: str, mode: str) -> None:
    vector_kwargs = {"context": "spawn"} if mode == "async" else None
    envs = gymnasium.make_vec(
        f"anm_gym:{name}", 2, mode, vector_kwargs=vector_kwargs, scene=SCENE, camera=CAMERA
    )
    first, _ = envs.reset(seed=7)
    after, *_ = envs.step(np.array([1, 2]))
    envs.close()
    for rank, action in enumerate((1, 2)):
        env = make(name)
        observation, _ = env.reset(seed=7 + rank)
        np.testing.assert_array_equal(first["depth"][rank], observation["depth"])
        observation, *_ = env.step(action)
        np.testing.assert_array_equal(after["depth"][rank], observation["depth"])


@pytest.mark.parametrize(("name", "budget"), list(zip(IDS, (1000, 500), strict=True)))
def test_budget_truncates(name: str, budget: int) -> None:
    assert gymnasium.spec(name).max_episode_steps == budget
    env = gymnasium.make(name, scene=SCENE, camera=CAMERA, max_episode_steps=3)
    env.reset(seed=0)
    assert [env.step(Action.TURN_LEFT)[3] for _ in range(3)] == [False, False, True]


def test_starts_are_uniform_over_the_largest_part(explore: Callable[..., ExploreEnv]) -> None:
    env = explore(camera={"width_px": 1, "height_px": 1}, reward="none")
    env.reset(seed=0)
    starts = []
    for _ in range(400):
        env.reset()
        starts.append([*env.simulator.state.position_xz, env.simulator.state.heading_rad])
    x, z, heading = np.array(starts).T
    np.testing.assert_allclose([x.mean(), z.mean()], 0.0, atol=0.2)
    np.testing.assert_allclose([x.std(), z.std()], 3.8 / np.sqrt(12.0), rtol=0.1)
    np.testing.assert_allclose([np.cos(heading).mean(), np.sin(heading).mean()], 0.0, atol=0.15)


def test_option_scene_holds_for_one_episode() -> None:
    env = make("ANM/Explore-v0")
    env.reset(seed=0, options={"scene": "home:studio:1"})
    assert env.scene.name == "home:studio:1"
    env.reset()
    assert env.scene.name == SCENE


def test_option_start_overrides_the_setting(explore: Callable[..., ExploreEnv]) -> None:
    env = explore(start=(1.0, 1.0, 0.0))
    env.reset(options={"start": (-1.0, 0.5, 1.0)})
    np.testing.assert_array_equal(env.simulator.state.position_xz, [-1.0, 0.5])
    env.reset()
    np.testing.assert_array_equal(env.simulator.state.position_xz, [1.0, 1.0])


def test_start_in_a_wall_is_refused_with_the_nearest_place(explore: Callable[..., ExploreEnv]) -> None:
    with pytest.raises(EpisodeError, match=r"`start` must be on the largest.*not navigable; the nearest"):
        explore(start=(1.98, 0.0, 0.0)).reset(seed=0)


def test_start_cut_off_from_the_largest_part_is_refused() -> None:
    env = make("ANM/Explore-v0")
    grid = env.simulator.grid
    x, z = grid.sample_position(np.random.default_rng(0), component=2)
    with pytest.raises(
        EpisodeError, match=r"`start` must be on the largest.*on a part of .* m2; the nearest"
    ):
        env.reset(options={"start": (x, z, 0.0)})


def test_failed_reset_leaves_no_half_begun_episode(explore: Callable[..., ExploreEnv]) -> None:
    env = explore()
    env.reset(seed=0)
    with pytest.raises(EpisodeError):
        env.reset(options={"start": (9.0, 9.0, 0.0)})
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(Action.TURN_LEFT)
    env.reset(seed=0)


@pytest.mark.parametrize("env_class", [ExploreEnv, PointNavEnv])
def test_wrong_settings_are_refused(env_class: type[MeshEnv]) -> None:
    with pytest.raises(ValueError, match=r"`render_mode` must be one of .*'ansi'"):
        env_class(render_mode="ansi")
    with pytest.raises(ValueError, match="`start` must be finite numbers"):
        env_class(start=(0.0, 0.0))
    with pytest.raises(TypeError, match="sceen"):
        env_class(sceen=SCENE)


def test_unknown_option_is_refused(explore: Callable[..., ExploreEnv]) -> None:
    with pytest.raises(ValueError, match="unknown reset option 'goal'"):
        explore().reset(options={"goal": (0.0, 0.0)})


@pytest.mark.parametrize("action", [4, -1])
def test_action_that_does_not_exist_is_refused(explore: Callable[..., ExploreEnv], action: int) -> None:
    env = explore()
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"`action` must be one of \[0, 1, 2, 3\], got"):
        env.step(action)
    assert len(env.trajectory) == 1


def test_nothing_works_before_reset(explore: Callable[..., ExploreEnv]) -> None:
    env = explore(render_mode="rgb_array")
    with pytest.raises(gymnasium.error.ResetNeeded, match="no episode has begun"):
        env.step(Action.STOP)
    with pytest.raises(gymnasium.error.ResetNeeded, match="nothing to draw"):
        env.render()


def test_depth_array_is_the_observed_depth(explore: Callable[..., ExploreEnv]) -> None:
    env = explore(render_mode="depth_array", noise=NOISE)
    observation, _ = env.reset(seed=0)
    depth = env.render()
    assert depth.dtype == np.float32
    np.testing.assert_array_equal(depth, observation["depth"][..., 0])


def test_render_without_a_mode_warns(explore: Callable[..., ExploreEnv]) -> None:
    env = explore()
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="`render` draws nothing without a `render_mode`"):
        assert env.render() is None


@pytest.mark.render
def test_colour_is_observed_on_request(explore: Callable[..., ExploreEnv]) -> None:
    env = explore(rgb=True)
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert observation["rgb"].shape == (16, 24, 3)


@pytest.mark.parametrize(
    ("camera", "what"),
    [
        ({"sensor_height_m": 0.0}, "`sensor_height_m` must be > 0 and finite, got 0.0"),
        ({"sensor_height_m": float("nan")}, "`sensor_height_m` must be > 0 and finite, got nan"),
        ({"max_depth_m": float("inf")}, "`max_depth_m` must be at most 10000, got inf; a pixel that shows"),
        ({"sensor_height_m": 5.0}, "`sensor_height_m` must be below the ceiling of room, 2.50 m above"),
        ({"width_px": "16"}, "`width_px` must be a whole number of pixels, got '16'"),
        ({"height_px": 16.0}, "`height_px` must be a whole number of pixels, got 16.0"),
        ({"hfov_deg": "90"}, "`hfov_deg` must be a number, got '90'"),
    ],
)
def test_camera_that_cannot_be_is_refused(
    explore: Callable[..., ExploreEnv], camera: dict[str, Any], what: str
) -> None:
    with pytest.raises((TypeError, ValueError), match=re.escape(what)):
        explore(camera=camera)


@pytest.mark.parametrize("steps", [{"forward_step_m": float("nan")}, {"turn_step_deg": float("inf")}])
def test_steps_that_are_no_lengths_are_refused(
    explore: Callable[..., ExploreEnv], steps: dict[str, float]
) -> None:
    with pytest.raises(ValueError, match="must be > 0 and finite"):
        explore(**steps)
