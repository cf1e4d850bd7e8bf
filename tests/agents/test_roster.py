from collections.abc import Callable

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.wrappers import TimeLimit
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor

from agents.roster import ROSTER, build_agent, parse_agent
from anm_gym.actions import Action
from anm_gym.envs.explore import ExploreEnv
from anm_gym.mesh import TriangleMesh

LIGHT = [
    "random",
    "random:forward",
    "random:spin",
    "bump_and_turn",
    "fbe:paper",
    "fbe:strong",
    "random_vertex",
    "nbv",
    "rh_nbv",
    "rh_nbv:paper",
]
"""Agents that need neither a neural map nor the cache of view tables."""


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("fbe", ("fbe", "strong")),
        ("fbe:paper", ("fbe", "paper")),
        ("fbe(paper)", ("fbe", "paper")),
        (" anm ", ("anm", "best")),
        ("anm(fast)", ("anm", "fast")),
        ("random", ("random", "uniform")),
    ],
)
def test_agent_is_spelled_with_or_without_its_preset(text: str, expected: tuple[str, str]) -> None:
    assert parse_agent(text) == expected


def test_unknown_agent_lists_the_choices() -> None:
    with pytest.raises(ValueError, match="unknown agent 'fbo'; choose one of: random, bump_and_turn, "):
        parse_agent("fbo")


def test_unknown_preset_lists_the_choices() -> None:
    with pytest.raises(
        ValueError, match="unknown preset 'weak' of agent 'fbe'; choose one of: strong, paper"
    ):
        parse_agent("fbe:weak")


def test_every_preset_can_be_spelled() -> None:
    for name, spec in ROSTER.items():
        assert [parse_agent(f"{name}:{preset}") for preset in spec.presets] == [
            (name, preset) for preset in spec.presets
        ]


@pytest.mark.parametrize("text", LIGHT)
def test_same_seed_replays_the_same_episode(
    explore: Callable[..., ExploreEnv], two_rooms: TriangleMesh, text: str
) -> None:
    agent = build_agent(text, explore(two_rooms), seed=5)
    episodes = []
    for _ in range(2):
        observation, _ = agent.env.reset(seed=4)
        actions: list[int] = []
        for step in range(40):
            action, _ = agent.policy.predict(observation, None, np.array([step == 0]), deterministic=True)
            actions.append(int(action))
            observation, *_ = agent.env.step(np.int64(action))
        episodes.append(actions)
    assert episodes[0] == episodes[1]
    assert Action.STOP not in episodes[0]


@pytest.mark.parametrize("text", LIGHT)
def test_stable_baselines_evaluates_every_agent(
    explore: Callable[..., ExploreEnv], two_rooms: TriangleMesh, text: str
) -> None:
    agent = build_agent(text, TimeLimit(explore(two_rooms), 15), seed=0)
    rewards, lengths = evaluate_policy(
        agent.policy, Monitor(agent.env), n_eval_episodes=2, return_episode_rewards=True
    )
    assert len(rewards) == 2
    assert lengths == [15, 15]


@pytest.mark.parametrize("text", ["upen:strong", "upen:paper", "upen:repo", "fbe:upen-repo"])
def test_agent_with_predictions_acts(
    explore: Callable[..., ExploreEnv], two_rooms: TriangleMesh, text: str
) -> None:
    agent = build_agent(text, explore(two_rooms), seed=0)
    observation, _ = agent.env.reset(seed=0)
    for step in range(5):
        action, _ = agent.policy.predict(observation, None, np.array([step == 0]))
        assert int(action) != Action.STOP
        observation, *_ = agent.env.step(np.int64(action))
    assert agent.env.compute_ms["predict"] > 0.0


def test_oracle_covers_most_of_a_room_in_forty_steps(
    explore: Callable[..., ExploreEnv],
    box_room: Callable[..., TriangleMesh],
    tmp_path: object,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("ANM_CACHE", str(tmp_path))
    agent = build_agent("oracle_coverage", explore(box_room(), start=(0.0, 0.0, 0.0)), seed=0)
    with pytest.raises(ResetNeeded, match="nothing is covered yet; call `reset` first"):
        _ = agent.env.get_wrapper_attr("covered_pct")
    observation, _ = agent.env.reset(seed=0)
    reasons = {agent.env.goal.reason}  # type: ignore[attr-defined]
    for step in range(40):
        action, _ = agent.policy.predict(observation, None, np.array([step == 0]))
        observation, *_ = agent.env.step(np.int64(action))
        reasons.add(agent.env.goal.reason)  # type: ignore[attr-defined]
    assert reasons == {"coverage"}
    assert agent.env.covered_pct > 75.0  # type: ignore[attr-defined]
