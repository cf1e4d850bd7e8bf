import gymnasium
import numpy as np
import pytest

from anm_gym.wrappers.neural_map import NeuralMapWrapper

SCENE = "home:studio:0"
CAMERA = {"width_px": 48, "height_px": 48}


@pytest.fixture
def env() -> NeuralMapWrapper:
    explore = gymnasium.make("anm_gym:ANM/Explore-v0", scene=SCENE, camera=CAMERA)
    return NeuralMapWrapper(explore, preset="fast")


def test_map_learns_from_every_observation(env: NeuralMapWrapper) -> None:
    env.reset(seed=0)
    for action in (2, 2, 1):
        _, _, _, _, info = env.step(np.int64(action))
    assert env.neural_map.num_frames == 4
    assert len(env.updates) == 4
    assert info["map_iterations"] > 0
    assert all(isinstance(info[key], float) for key in ("distance_loss", "eikonal_loss", "normal_loss"))


def test_reset_begins_an_empty_map(env: NeuralMapWrapper) -> None:
    env.reset(seed=0)
    first = env.neural_map
    env.reset(seed=0)
    assert env.neural_map is not first
    assert env.neural_map.num_frames == 1


def test_same_seed_learns_the_same_map(env: NeuralMapWrapper) -> None:
    predictions = []
    for _ in range(2):
        observation, _ = env.reset(seed=3)
        env.step(np.int64(2))
        predictions.append(env.neural_map.sdf(observation["world_from_camera"][None, :3, 3]))
    assert predictions[0] == predictions[1]


def test_episodes_without_a_seed_have_maps_of_their_own(env: NeuralMapWrapper) -> None:
    """But after a seed they are the same each time."""
    point = np.zeros((1, 3), np.float32)

    def episodes() -> list[float]:
        env.reset(seed=3)
        maps = [env.neural_map]
        for _ in range(2):
            env.reset()
            maps.append(env.neural_map)
        return [neural_map.variability(point).item() for neural_map in maps]

    first = episodes()
    assert len(set(first)) == 3
    assert episodes() == first


def test_compute_is_kept_outside_info(env: NeuralMapWrapper) -> None:
    _, info = env.reset(seed=0)
    assert {"observe", "learn"} <= set(env.compute_ms)
    assert not any("ms" in key for key in info)


def test_wrapped_environment_can_be_made_again_from_its_spec(env: NeuralMapWrapper) -> None:
    again = gymnasium.make(env.spec)
    assert again.has_wrapper_attr("neural_map")
    assert again.get_wrapper_attr("settings").preset == "fast"


def test_unknown_preset_is_refused() -> None:
    explore = gymnasium.make("anm_gym:ANM/Explore-v0", scene=SCENE, camera=CAMERA)
    with pytest.raises(ValueError, match="unknown map preset 'quick'"):
        NeuralMapWrapper(explore, preset="quick")
