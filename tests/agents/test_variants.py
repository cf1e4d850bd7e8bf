from collections.abc import Callable

import numpy as np
import pytest

from agents.navigators import NAVIGATORS
from agents.planning_navigators import OracleNavigator, PlannerNavigator
from agents.roster import ROSTER, build_agent, parse_agent
from agents.variants import (
    MAP_VARIANTS,
    NAVIGATOR_VARIANTS,
    SELECT_VARIANTS,
    Substitutions,
    split_variants,
    substitutions,
)
from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.mesh import TriangleMesh
from anm_gym.wrappers.variability_goal import VariabilityGoalWrapper
from train.episodes import split_agent
from train.provenance import digest, effective_settings

Explore = Callable[..., ExploreEnv]


def test_every_navigator_and_criterion_is_a_variant_and_no_two_share_a_name() -> None:
    assert set(NAVIGATOR_VARIANTS) == {f"nav={name}" for name in NAVIGATORS}
    assert set(SELECT_VARIANTS) == {
        "select=variance", "select=mean", "select=count", "select=area", "select=distance",
    }  # fmt: skip
    names = [*NAVIGATOR_VARIANTS, *SELECT_VARIANTS, *MAP_VARIANTS]
    assert len(set(names)) == len(names)


def test_preset_is_taken_apart_by_what_its_variants_concern() -> None:
    assert substitutions("best") == Substitutions("best", "best", "best")
    assert substitutions("paper+relu+select=count+dropout+nav=oracle") == Substitutions(
        base="paper",
        map_preset="paper+relu+dropout",
        goal_preset="paper+relu+select=count+dropout",
        select="count",
        navigator="oracle",
    )


def test_plus_inside_the_name_of_a_variant_does_not_split_it() -> None:
    known = ["relu", "nav=ddppo", "nav=ddppo+fallback"]
    assert split_variants("best+nav=ddppo+fallback+relu", known) == ("best", ["nav=ddppo+fallback", "relu"])
    assert split_variants("best+nav=ddppo+relu", known) == ("best", ["nav=ddppo", "relu"])
    assert substitutions("best+nav=ddppo+fallback").navigator == "ddppo+fallback"


@pytest.mark.parametrize(
    "preset",
    [
        *("best+nav=oracle+nav=planner", "best+select=area+select=mean", "best+dropout+laplace"),
        *("best+no_replay+uniform_replay", "best+relu+relu"),
    ],
)
def test_variants_of_one_kind_exclude_each_other(preset: str) -> None:
    with pytest.raises(ValueError, match="must be given once behind a preset, got"):
        parse_agent(f"anm:{preset}")


def test_unknown_variants_are_refused_with_the_choices() -> None:
    with pytest.raises(
        ValueError, match=r"unknown variant 'nav=teleport' of agent 'fbe'; choose one of: nav="
    ):
        parse_agent("fbe:strong+nav=teleport")
    with pytest.raises(ValueError, match="unknown variant 'select=luck' of agent 'anm'"):
        parse_agent("anm:best+select=luck")
    with pytest.raises(ValueError, match="unknown variant 'select=area' of agent 'fbe'"):
        parse_agent("fbe:strong+select=area")


def test_rows_carry_the_whole_name_of_a_variant() -> None:
    assert split_agent("anm:best+nav=oracle") == ("anm", "best+nav=oracle")
    assert split_agent("random_vertex") == ("random_vertex", "")
    assert split_agent("random_vertex:uniform+nav=oracle") == ("random_vertex", "uniform+nav=oracle")


@pytest.mark.parametrize("name", [name for name, spec in ROSTER.items() if "nav=oracle" in spec.variants])
def test_every_source_of_goals_takes_another_navigator(name: str) -> None:
    preset = ROSTER[name].presets[0]
    assert parse_agent(f"{name}:{preset}+nav=oracle") == (name, f"{preset}+nav=oracle")


def test_oracle_drives_where_it_is_asked_for(explore: Explore, two_rooms: TriangleMesh) -> None:
    plain = build_agent("nbv", explore(two_rooms), seed=0)
    agent = build_agent("nbv:strong+nav=oracle", explore(two_rooms), seed=0)
    assert isinstance(plain.policy, PlannerNavigator)
    assert isinstance(agent.policy, OracleNavigator)
    assert agent.preset == "strong+nav=oracle"
    first, second = (digest(effective_settings(each.env, each.policy)) for each in (plain, agent))
    assert first != second
    observation, _ = agent.env.reset(seed=0)
    for step in range(5):
        action, _ = agent.policy.predict(observation, None, np.array([step == 0]))
        assert int(action) != Action.STOP
        observation, *_ = agent.env.step(np.int64(action))


@pytest.mark.parametrize(
    ("preset", "keep_share"), [("best+select=area", 0.10), ("released+select=distance", 0.80)]
)
def test_criterion_replaces_that_of_the_presets_clusters(
    explore: Explore, two_rooms: TriangleMesh, preset: str, keep_share: float
) -> None:
    agent = build_agent(f"anm:{preset}", explore(two_rooms), seed=0)
    assert isinstance(agent.env, VariabilityGoalWrapper)
    assert agent.env.targets is not None
    assert f"select={agent.env.targets.criterion}" in preset
    assert agent.env.targets.keep_share == keep_share
    assert agent.env.limits.arrival_m == 0.8


def test_modules_of_the_ablation_change_the_map_alone(explore: Explore, two_rooms: TriangleMesh) -> None:
    dropout, relu = (build_agent(f"anm:fast+{name}", explore(two_rooms)) for name in ("dropout", "relu"))
    learned = dropout.env.get_wrapper_attr("neural_map").settings
    assert (learned.field.dropout, learned.variability.family, learned.variability.draws) == (
        0.05,
        "dropout",
        5,
    )
    assert relu.env.get_wrapper_attr("neural_map").settings.field.activation == "relu"
    assert isinstance(dropout.policy, type(relu.policy))
