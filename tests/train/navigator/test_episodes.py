"""Episodes for comparison: the same for everyone, played side by side or one by one."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from agents.learned_navigator import DDPPONavigator
from agents.navigator_net import NavigatorNet, NavigatorNetSettings
from agents.navigators import LEARNED, NAVIGATORS
from agents.policy_file import save_policy
from train.navigator.driven import play_driven
from train.navigator.episodes import RESULTS, NavigationEpisode, episodes_of, play_learned
from train.navigator.table import (
    Job,
    NavigationComparison,
    compare_navigators,
    play,
    policy_digest,
    summarise,
)

SCENES = ["home:studio:1", "home:studio:2"]


@pytest.fixture
def net(tiny_net: NavigatorNetSettings) -> NavigatorNet:
    """Give a network that likes to walk, and to stop now and then."""
    torch.manual_seed(1)
    net = NavigatorNet(tiny_net).eval()
    with torch.no_grad():
        net.actor.bias.copy_(torch.tensor([-3.0, 1.0, 0.0, 0.0]))
    return net


def test_episodes_are_spread_over_the_scenes() -> None:
    episodes = episodes_of(SCENES, 5, 0.25)
    assert [(one.scene, one.seed) for one in episodes] == [
        *((SCENES[0], seed) for seed in range(3)),
        *((SCENES[1], seed) for seed in range(2)),
    ]


def test_agents_side_by_side_do_what_one_does_alone(net: NavigatorNet) -> None:
    episodes = episodes_of(SCENES, 4, 0.25)
    together = play_learned(net, episodes, deterministic=True, num_agents=3)
    alone = [play_learned(net, [one], deterministic=True)[0] for one in episodes]
    for first, second in zip(together, alone, strict=True):
        assert first.keys() == set(RESULTS)
        assert first["step"] == second["step"]
        assert first["distance_to_goal_m"] == pytest.approx(second["distance_to_goal_m"], abs=1e-3)


def test_drawn_actions_are_those_of_the_episode_whoever_plays_beside_it(net: NavigatorNet) -> None:
    """So that a comparison which goes on, or is made longer, has the rows of one that was never stopped."""
    episodes = episodes_of(SCENES, 4, 0.25)
    together = play_learned(net, episodes, deterministic=False, num_agents=3)
    alone = [play_learned(net, [one], deterministic=False)[0] for one in reversed(episodes)]
    assert [one["step"] for one in together] == [one["step"] for one in reversed(alone)]
    assert together != play_learned(net, episodes, deterministic=True)


def test_different_steps_cannot_be_played_together(net: NavigatorNet) -> None:
    episodes = [NavigationEpisode(SCENES[0], 0, step) for step in (0.1, 0.25)]
    with pytest.raises(ValueError, match=r"`episodes` must have one length of a step, got \[0.1, 0.25\]"):
        play_learned(net, episodes, deterministic=True)


@pytest.mark.parametrize("navigator", ["planner", "oracle"])
def test_planners_arrive_and_stop(navigator: str) -> None:
    result = play_driven(navigator, NavigationEpisode(SCENES[0], 0, 0.25), 48)
    assert result["is_success"]
    assert result["distance_to_goal_m"] < 0.2
    assert result["cpu_ms"] > 0.0


def test_table_goes_on_where_it_stopped(net: NavigatorNet, tmp_path: Path, monkeypatch, capsys) -> None:
    path = tmp_path / "walker.safetensors"
    save_policy(net, path)
    comparison = NavigationComparison(
        [str(path)], SCENES, 2, 0.25, deterministic=True, workers=0, out=tmp_path
    )
    lines = compare_navigators(comparison, tmp_path / "table.json")
    assert [line["scene"] for line in lines] == [*SCENES, "all"]
    assert "walker.safetensors" in capsys.readouterr().out
    monkeypatch.setattr("train.navigator.table.play", None)
    assert compare_navigators(comparison) == lines
    assert (tmp_path / "table.json").read_text().count('"success"') == 3


def test_folder_that_another_process_plays_into_is_refused(net: NavigatorNet, tmp_path: Path, held) -> None:
    save_policy(net, path := tmp_path / "walker.safetensors")
    comparison = NavigationComparison(
        [str(path)], SCENES[:1], 1, 0.25, deterministic=True, workers=0, out=tmp_path
    )
    with held(tmp_path), pytest.raises(ValueError, match="no other process writes to"):
        compare_navigators(comparison)
    assert len(compare_navigators(comparison)) == 1


def test_planners_keep_what_they_have_played_when_one_episode_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    comparison = NavigationComparison(
        ["oracle"], SCENES[:1], 2, 0.25, deterministic=False, workers=0, out=tmp_path
    )
    real = play_driven

    def failing(name: str, episode: NavigationEpisode, image_px: int) -> dict:
        if episode.seed == 1:
            raise RuntimeError("power cut")
        return real(name, episode, image_px)

    monkeypatch.setattr("train.navigator.table.play_driven", failing)
    with pytest.raises(RuntimeError, match="power cut"):
        compare_navigators(comparison)
    assert len((tmp_path / "episodes.jsonl").read_text().splitlines()) == 1


def test_rows_of_other_weights_are_not_taken_for_new_ones(net: NavigatorNet, tmp_path: Path) -> None:
    path = tmp_path / "walker.safetensors"
    save_policy(net, path)
    comparison = NavigationComparison(
        [str(path)], SCENES[:1], 1, 0.25, deterministic=True, workers=0, out=tmp_path
    )
    before = policy_digest(str(path))
    compare_navigators(comparison)
    with torch.no_grad():
        net.actor.bias += 0.1
    save_policy(net, path)
    assert policy_digest(str(path)) != before
    compare_navigators(comparison)
    assert len((tmp_path / "episodes.jsonl").read_text().splitlines()) == 2


def test_rows_that_other_code_played_are_named(
    net: NavigatorNet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    save_policy(net, path := tmp_path / "walker.safetensors")
    comparison = NavigationComparison(
        [str(path)], SCENES[:1], 2, 0.25, deterministic=True, workers=0, out=tmp_path
    )
    monkeypatch.setattr("train.navigator.table.versions", lambda: {"commit": "1234567"})
    compare_navigators(replace(comparison, episodes=1))
    assert "note:" not in capsys.readouterr().out
    monkeypatch.setattr("train.navigator.table.versions", lambda: {"commit": "89abcde"})
    compare_navigators(comparison)
    assert "note: the code at hand is 89abcde; episodes played: 1 at 1234567" in capsys.readouterr().out


def test_handover_is_in_the_row_and_in_the_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A navigator that never comes nearer hands its goal to the planner, which arrives."""
    eager = replace(LEARNED["ddppo+fallback"], patience_steps=0, progress_m=9.0)
    monkeypatch.setitem(NAVIGATORS, "ddppo+fallback", lambda env, seed: DDPPONavigator(env, eager, seed))
    comparison = NavigationComparison(
        ["ddppo+fallback"], SCENES[:1], 1, 0.25, deterministic=False, workers=0, out=tmp_path
    )
    (line,) = compare_navigators(comparison)
    row = json.loads((tmp_path / "episodes.jsonl").read_text())
    assert (row["handovers"], row["is_success"], line["handovers"]) == (1, True, 1.0)


@pytest.mark.parametrize("name", ["ddppo", "ddppo-plus", "ddppo-star"])
def test_plain_learned_navigators_are_played_many_at_a_time(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("train.navigator.table.play_driven", None)
    job = Job(name, deterministic=False, episodes=(NavigationEpisode(SCENES[0], 0, 0.25),))
    assert play(job)[0]["draws"] == "sampled"


def test_missing_episodes_alone_are_played(net: NavigatorNet, tmp_path: Path) -> None:
    path = tmp_path / "walker.safetensors"
    save_policy(net, path)
    comparison = NavigationComparison(
        [str(path)], SCENES[:1], 1, 0.25, deterministic=True, workers=0, out=tmp_path
    )
    compare_navigators(comparison)
    compare_navigators(replace(comparison, episodes=2))
    rows = [json.loads(line) for line in (tmp_path / "episodes.jsonl").read_text().splitlines()]
    assert [row["seed"] for row in rows] == [0, 1]


def test_scenes_must_have_different_names() -> None:
    with pytest.raises(
        ValueError, match="`scenes` must have different names in rows and files, got mesh, mesh"
    ):
        NavigationComparison(["oracle"], ["a/mesh.ply", "b/mesh.ply"], 1, 0.25, deterministic=False)


def test_line_of_the_table_is_what_a_hand_counts() -> None:
    rows = [
        {
            "scene": "one",
            "draws": "own",
            "step_m": 0.25,
            "is_success": success,
            "spl": spl,
            "soft_spl": 0.5,
            "collisions": count,
        }
        for success, spl, count in ((True, 1.0, 0), (True, 0.5, 4), (False, 0.0, 2))
    ]
    line = summarise("planner", "all", rows)
    assert line["success"] == pytest.approx(2 / 3)
    assert line["success_low"] == pytest.approx(0.208, abs=1e-3)
    assert (line["spl"], line["collisions"]) == (0.5, 2.0)
    assert line["soft_spl_half_width"] == pytest.approx(0.0)


def test_interval_of_several_scenes_is_over_the_scenes() -> None:
    """Two scenes of a hundred goals each tell of two scenes, not of two hundred goals."""
    episode = {"draws": "own", "step_m": 0.25, "soft_spl": 0.5, "collisions": 0}
    rows = [
        {**episode, "scene": scene, "is_success": number < reached, "spl": share}
        for scene, reached, share in (("easy", 100, 0.9), ("hard", 80, 0.5))
        for number in range(100)
    ]
    line = summarise("planner", "all", rows)
    assert (line["success"], line["spl"]) == (pytest.approx(0.9), pytest.approx(0.7))
    assert line["spl_half_width"] == pytest.approx(12.706 * 0.2, rel=1e-3), "t of one degree of freedom"
    assert (line["success_low"], line["success_high"]) == (0.0, 1.0)
    one = summarise("planner", "easy", rows[:100])
    assert one["success_low"] == pytest.approx(0.963, abs=1e-3), "Wilson's, as 100 of 100 vary not at all"


def test_scenes_without_an_episode_are_not_left_out_silently() -> None:
    with pytest.raises(ValueError, match="`episodes` must be >= 1 for each of 2 scenes, got 1"):
        NavigationComparison(["oracle"], SCENES, 1, 0.25, deterministic=False)


def test_navigator_that_always_draws_is_not_asked_for_its_likeliest_actions() -> None:
    with pytest.raises(ValueError, match="must not name ddppo\\+fallback where the likeliest actions"):
        NavigationComparison(["planner", "ddppo+fallback"], SCENES, 2, 0.25, deterministic=True)


def test_repeated_navigator_is_refused() -> None:
    with pytest.raises(ValueError, match="`navigators` must differ, got oracle, oracle"):
        NavigationComparison(["oracle", "oracle"], SCENES, 2, 0.25, deterministic=False)


def test_unknown_navigator_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown navigator 'walker'; choose one of: ddppo, "):
        NavigationComparison(["walker"], SCENES, 1, 0.25, deterministic=False)
