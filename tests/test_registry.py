"""Every registered id: plain entry points, a spec that survives JSON, one step of an episode."""

import importlib
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from anm_gym.actions import Action
from anm_gym.registration import IDS

SMALL_CAMERA = {"width_px": 16, "height_px": 16}
SCENE = "home:studio:0"


def test_registry_holds_the_documented_ids_and_no_other() -> None:
    assert {name for name in gymnasium.registry if name.startswith("ANM/")} == set(IDS)


@pytest.mark.parametrize("name", IDS)
def test_entry_point_is_a_string_that_leads_to_a_documented_callable(name: str) -> None:
    entry_point = gymnasium.spec(name).entry_point
    assert isinstance(entry_point, str)
    module, attribute = entry_point.split(":")
    target = getattr(importlib.import_module(module), attribute)
    assert callable(target)
    assert target.__doc__


@pytest.mark.parametrize("name", IDS)
def test_spec_survives_json(name: str) -> None:
    spec = gymnasium.spec(name)
    assert EnvSpec.from_json(spec.to_json()) == spec


@pytest.mark.parametrize("name", IDS)
def test_first_step_stays_in_the_spaces(name: str) -> None:
    env = gymnasium.make(name, scene=SCENE, camera=SMALL_CAMERA)
    observation, _ = env.reset(seed=3)
    assert env.observation_space.contains(observation)
    observation, reward, terminated, truncated, info = env.step(Action.TURN_LEFT)
    assert env.observation_space.contains(observation)
    assert np.isfinite(float(reward))
    assert not terminated
    assert not truncated
    assert info["step"] == 1
    env.close()


@pytest.mark.parametrize("name", IDS)
def test_environment_can_be_made_again_from_its_spec(name: str) -> None:
    env = gymnasium.make(name, scene=SCENE, camera=SMALL_CAMERA)
    twin = gymnasium.make(env.spec)
    first, _ = env.reset(seed=3)
    second, _ = twin.reset(seed=3)
    np.testing.assert_array_equal(first["depth"], second["depth"])
    env.close()
    twin.close()


def test_prefixed_id_registers_by_itself() -> None:
    code = f"import gymnasium; print(gymnasium.make('anm_gym:ANM/Explore-v0', scene={SCENE!r}).spec.id)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "ANM/Explore-v0"
