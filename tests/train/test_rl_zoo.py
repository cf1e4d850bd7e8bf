"""The RL Zoo's files: what they name exists and learns; the zoo itself is not needed."""

import importlib
from pathlib import Path
from typing import Any

import gymnasium
import pytest
import yaml
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO

FOLDER = Path(__file__).resolve().parents[2] / "configs" / "rl_zoo"
ALGORITHMS = {"ppo": PPO, "ppo_lstm": RecurrentPPO}
IDS = ("ANM/Explore-v0", "ANM/PointNav-v0")
OF_THE_ZOO = (
    "env_kwargs",
    "env_wrapper",
    "monitor_kwargs",
    "policy",
    "policy_kwargs",
    "n_envs",
    "n_timesteps",
)


def named(path: str) -> Any:
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


def read(algorithm: str, env_id: str) -> dict[str, Any]:
    return yaml.safe_load((FOLDER / f"{algorithm}.yml").read_text(encoding="utf-8"))[env_id]


def make(settings: dict[str, Any], env_id: str) -> gymnasium.Env:
    """Wrap an environment as the zoo does."""
    env = gymnasium.make(f"anm_gym:{env_id}", **settings["env_kwargs"])
    for entry in settings["env_wrapper"]:
        path, arguments = next(iter(entry.items())) if isinstance(entry, dict) else (entry, {})
        env = named(path)(env, **arguments)
    return env


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_file_names_what_exists_and_learns(algorithm: str, env_id: str) -> None:
    settings = read(algorithm, env_id)
    learner = {name: value for name, value in settings.items() if name not in OF_THE_ZOO}
    assert settings["n_envs"] * learner["n_steps"] % learner["batch_size"] == 0
    policy_kwargs = eval(settings.get("policy_kwargs", "{}"), {"dict": dict})
    small = {**learner, "n_steps": 8, "batch_size": 8, "n_epochs": 1}
    model = ALGORITHMS[algorithm](
        named(settings["policy"]), make(settings, env_id), policy_kwargs=policy_kwargs, seed=0, **small
    )
    before = next(model.policy.parameters()).clone()
    model.learn(8)
    assert (next(model.policy.parameters()) != before).any()


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_what_is_monitored_is_in_the_info(algorithm: str, env_id: str) -> None:
    """The zoo's monitor sits under the wrappers, so it sees the environment's own info only."""
    settings = read(algorithm, env_id)
    keys = eval(settings["monitor_kwargs"], {"dict": dict})["info_keywords"]
    bare = gymnasium.make(f"anm_gym:{env_id}", **settings["env_kwargs"], scene="home:studio:0")
    assert set(keys) <= set(bare.reset(seed=0)[1])
