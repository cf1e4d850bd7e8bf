"""Every agent by name: what a table's rows may be."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import gymnasium

from agents.navigators import make_navigator
from agents.reactive import BumpAndTurnPolicy, RandomPolicy
from anm_gym.map.presets import VARIANTS

Env = gymnasium.Env[Any, Any]


@dataclass(frozen=True)
class Agent:
    """A decision maker, bound to its environment."""

    name: str
    """Name in the roster."""
    preset: str
    """Preset in force; empty where there is only one."""
    env: Env
    """The environment with the wrappers that the agent needs."""
    policy: Any
    """Chooses actions through Stable-Baselines3's `predict`."""


@dataclass(frozen=True)
class AgentSpec:
    """How an agent is built."""

    presets: tuple[str, ...]
    """Its presets, the default one first."""
    build: Callable[[Env, str, int], tuple[Env, Any]]
    """Maps a bare exploration environment, a preset and a seed to the wrapped one and a policy."""
    variants: tuple[str, ...] = ()
    """Substitutions that may follow a preset, each behind a "+"."""


def parse_agent(text: str) -> tuple[str, str]:
    """Split ``name``, ``name:preset``, ``name:preset+variant`` or ``name(preset)``.

    Returns:
        Name and preset; the default preset where none is given.

    Raises:
        ValueError: If the agent or its preset is unknown.
    """
    name, _, preset = text.strip().removesuffix(")").replace("(", ":").partition(":")
    if name not in ROSTER:
        raise ValueError(f"unknown agent {name!r}; choose one of: {', '.join(sorted(ROSTER))}")
    presets = ROSTER[name].presets
    preset = preset or presets[0]
    base, *variants = preset.split("+")
    if base not in presets:
        raise ValueError(f"unknown preset {base!r} of agent {name!r}; choose one of: {', '.join(presets)}")
    for variant in variants:
        if variant not in ROSTER[name].variants:
            known = ", ".join(ROSTER[name].variants) or "none"
            raise ValueError(f"unknown variant {variant!r} of agent {name!r}; choose one of: {known}")
    return name, preset


def build_agent(text: str, env: Env, seed: int = 0) -> Agent:
    """Build an agent over a bare exploration environment.

    Args:
        text: ``name``, ``name:preset`` or ``name(preset)``.
        env: `ANM/Explore-v0`.
        seed: Seeds whatever the agent draws.

    Raises:
        ValueError: If the agent or its preset is unknown.
    """
    name, preset = parse_agent(text)
    wrapped, policy = ROSTER[name].build(env, preset, seed)
    return Agent(name, preset, wrapped, policy)


def _random(env: Env, _preset: str, seed: int) -> tuple[Env, Any]:
    return env, RandomPolicy(seed)


def _bump_and_turn(env: Env, _preset: str, seed: int) -> tuple[Env, Any]:
    return env, BumpAndTurnPolicy(seed)


def _fbe(env: Env, preset: str, seed: int) -> tuple[Env, Any]:
    from anm_gym.wrappers.frontier_goal import FrontierGoalWrapper

    wrapped = FrontierGoalWrapper(env, preset=preset, seed=seed)
    return wrapped, make_navigator("planner", wrapped, seed)


def _anm(env: Env, preset: str, seed: int) -> tuple[Env, Any]:
    from anm_gym.wrappers.neural_map import NeuralMapWrapper
    from anm_gym.wrappers.variability_goal import VariabilityGoalWrapper

    mapped = NeuralMapWrapper(env, preset=preset, seed=seed)
    wrapped = VariabilityGoalWrapper(mapped, preset=preset, seed=seed)
    return wrapped, make_navigator("planner", wrapped, seed)


def _oracle_coverage(env: Env, _preset: str, seed: int) -> tuple[Env, Any]:
    from agents.oracle_coverage import OracleCoverageGoalWrapper

    wrapped = OracleCoverageGoalWrapper(env, seed=seed)
    return wrapped, make_navigator("oracle", wrapped, seed)


ROSTER: Final = {
    "random": AgentSpec(("uniform",), _random),
    "bump_and_turn": AgentSpec(("default",), _bump_and_turn),
    "fbe": AgentSpec(("strong", "paper"), _fbe),
    "anm": AgentSpec(("best", "fast", "paper", "released"), _anm, tuple(VARIANTS)),
    "oracle_coverage": AgentSpec(("greedy",), _oracle_coverage),
}
"""All agents, from the floor to the upper bound."""
