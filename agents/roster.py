"""Every agent by name: what a table's rows may be."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pkgutil import resolve_name
from typing import Any, Final

import gymnasium

from agents.navigators import make_navigator
from agents.reactive import BumpAndTurnPolicy, RandomPolicy, SpinAndWalkPolicy
from agents.variants import (
    MAP_VARIANTS,
    NAVIGATOR_VARIANTS,
    SELECT_VARIANTS,
    split_variants,
    substitutions,
)
from anm_gym.checks import check_known

Env = gymnasium.Env[Any, Any]
Builder = Callable[[Env, str, int], tuple[Env, Any]]


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
    build: Builder
    """Maps a bare exploration environment, a preset and a seed to the wrapped one and a policy."""
    variants: tuple[str, ...] = ()
    """Substitutions that may follow a preset, each behind a "+"."""


def parse_agent(text: str) -> tuple[str, str]:
    """Split ``name``, ``name:preset``, ``name:preset+variant`` or ``name(preset)``.

    Returns:
        Name and preset; the default preset where none is given.

    Raises:
        ValueError: If the agent, its preset or a variant is unknown, or two variants exclude each other.
    """
    name, _, preset = text.strip().removesuffix(")").replace("(", ":").partition(":")
    check_known("agent", name, ROSTER)
    presets = ROSTER[name].presets
    preset = preset or presets[0]
    base, variants = split_variants(preset, ROSTER[name].variants)
    if base not in presets:
        raise ValueError(f"unknown preset {base!r} of agent {name!r}; choose one of: {', '.join(presets)}")
    for variant in variants:
        if variant not in ROSTER[name].variants:
            known = ", ".join(ROSTER[name].variants) or "none"
            raise ValueError(f"unknown variant {variant!r} of agent {name!r}; choose one of: {known}")
    substitutions(preset)
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
    parts = substitutions(preset)
    wrapped, policy = ROSTER[name].build(env, parts.goal_preset, seed)
    if parts.navigator is not None:
        policy = make_navigator(parts.navigator, wrapped, seed)
    return Agent(name, preset, wrapped, policy)


def _goals_of(wrapper: str, **options: Any) -> Builder:
    """Let a goal wrapper that needs no map below it propose, and the planner drive.

    Args:
        wrapper: ``module:class``; imported when an agent is built.
        options: Its arguments besides the environment, the preset and the seed.
    """

    def build(env: Env, preset: str, seed: int) -> tuple[Env, Any]:
        wrapped = resolve_name(wrapper)(env, preset=preset, seed=seed, **options)
        return wrapped, make_navigator("planner", wrapped, seed)

    return build


def _random(env: Env, preset: str, seed: int) -> tuple[Env, Any]:
    if preset != "spin":
        return env, RandomPolicy(seed, preset)
    return env, SpinAndWalkPolicy(seed, *_step_sizes(env))


def _bump_and_turn(env: Env, _preset: str, seed: int) -> tuple[Env, Any]:
    return env, BumpAndTurnPolicy(seed, *_step_sizes(env))


def _step_sizes(env: Env) -> tuple[float, float]:
    """Length of a step, metres, and angle of a turn, degrees."""
    forward_step_m, turn_step_rad = env.get_wrapper_attr("step_sizes")
    return float(forward_step_m), math.degrees(turn_step_rad)


def _fbe(env: Env, preset: str, seed: int) -> tuple[Env, Any]:
    from anm_gym.wrappers.frontier_goal import PRESETS, FrontierGoalWrapper

    source = None
    if PRESETS[preset].map_source == "predicted":
        from agents.predicted_floor import PredictedFloor
        from agents.upen import shipped_ensemble

        source = PredictedFloor(shipped_ensemble())
    wrapped = FrontierGoalWrapper(env, preset=preset, seed=seed, source=source)
    return wrapped, make_navigator("planner", wrapped, seed)


def _anm(env: Env, preset: str, seed: int) -> tuple[Env, Any]:
    from anm_gym.map.targets import PAPER_TARGETS
    from anm_gym.wrappers.neural_map import NeuralMapWrapper
    from anm_gym.wrappers.variability_goal import CLUSTER_PRESETS, VariabilityGoalWrapper

    parts = substitutions(preset)
    targets = None
    if parts.select is not None:
        targets = replace(CLUSTER_PRESETS.get(parts.base, PAPER_TARGETS), criterion=parts.select)
    mapped = NeuralMapWrapper(env, preset=parts.map_preset, seed=seed)
    wrapped = VariabilityGoalWrapper(mapped, preset=parts.map_preset, seed=seed, targets=targets)
    return wrapped, make_navigator("planner", wrapped, seed)


def _random_vertex(env: Env, _preset: str, seed: int) -> tuple[Env, Any]:
    from agents.random_vertex import RandomVertexGoalWrapper

    wrapped = RandomVertexGoalWrapper(env, seed=seed)
    return wrapped, make_navigator("planner", wrapped, seed)


def _voronoi(env: Env, preset: str, seed: int) -> tuple[Env, Any]:
    from agents.voronoi import MAP_PRESETS, VoronoiGoalWrapper
    from anm_gym.wrappers.neural_map import NeuralMapWrapper

    base, *variants = preset.split("+")
    mapped = NeuralMapWrapper(env, preset="+".join([MAP_PRESETS[base], *variants]), seed=seed)
    wrapped = VoronoiGoalWrapper(mapped, preset=base, seed=seed)
    return wrapped, make_navigator("planner", wrapped, seed)


def _oracle_coverage(env: Env, _preset: str, seed: int) -> tuple[Env, Any]:
    from agents.oracle_coverage import OracleCoverageGoalWrapper

    wrapped = OracleCoverageGoalWrapper(env, seed=seed)
    return wrapped, make_navigator("oracle", wrapped, seed)


ROSTER: Final = {
    "random": AgentSpec(("uniform", "forward", "spin"), _random),
    "bump_and_turn": AgentSpec(("default",), _bump_and_turn),
    "random_vertex": AgentSpec(("uniform",), _random_vertex, NAVIGATOR_VARIANTS),
    "fbe": AgentSpec(("strong", "paper", "upen-repo"), _fbe, NAVIGATOR_VARIANTS),
    "nbv": AgentSpec(("strong", "exponential"), _goals_of("agents.nbv:NbvGoalWrapper"), NAVIGATOR_VARIANTS),
    "rh_nbv": AgentSpec(("strong", "paper"), _goals_of("agents.rh_nbv:RhNbvGoalWrapper"), NAVIGATOR_VARIANTS),
    "upen": AgentSpec(
        ("strong", "paper", "repo", "metres"), _goals_of("agents.upen:UpenGoalWrapper"), NAVIGATOR_VARIANTS
    ),
    "occant": AgentSpec(
        ("metres", "steps"),
        _goals_of("agents.occant:OccAntGoalWrapper", anticipation=True),
        NAVIGATOR_VARIANTS,
    ),
    "ans": AgentSpec(
        ("metres", "steps"),
        _goals_of("agents.occant:OccAntGoalWrapper", anticipation=False),
        NAVIGATOR_VARIANTS,
    ),
    "anm": AgentSpec(
        ("best", "fast", "paper", "released"), _anm, (*MAP_VARIANTS, *SELECT_VARIANTS, *NAVIGATOR_VARIANTS)
    ),
    "voronoi": AgentSpec(("best", "fast", "scale"), _voronoi, (*MAP_VARIANTS, *NAVIGATOR_VARIANTS)),
    "oracle_coverage": AgentSpec(("greedy",), _oracle_coverage),
}
"""All agents, from the floor to the upper bound."""
