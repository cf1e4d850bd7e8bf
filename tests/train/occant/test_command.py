import json
from pathlib import Path

import pytest

import train.occant.__main__ as command
from agents.occant_model import load_model
from train.occant import frames as occant_frames
from train.occant.__main__ import OccAntTraining, format_coverage, main, read_options, training_of

TINY = [
    "--frame_homes",
    "1",
    "--goal_homes",
    "1",
    "--test_homes",
    "1",
    "--frames_per_home",
    "4",
    "--width",
    "2",
]
TINY += ["--gain_episodes", "1", "--gain_passes", "64"]
TINY += ["--passes", "40", "--updates", "2", "--value_updates", "1", "--envs", "1", "--test_episodes", "1"]


@pytest.fixture(autouse=True)
def small_homes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every home be a studio."""
    monkeypatch.setattr(occant_frames, "TIERS", ("studio",))


def test_command_trains_writes_goes_on_and_ships(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out, weights = tmp_path / "run", tmp_path / "weights"
    arguments = [*TINY, "--out", str(out), "--json", str(tmp_path / "report.json")]
    main(arguments)
    printed = capsys.readouterr().out
    assert "anticipated" in printed
    assert "random goals" in printed
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert report["settings"]["reward"] == "map_accuracy"
    assert report["anticipator"]["scores"]["frames"] == 4
    assert len(report["policy"]["curve"]) == 2
    assert {len(shares) for shares in report["policy"]["coverage"].values()} == {11}
    assert len(report["policy"]["gains"]) == 1
    names = ("anticipator.safetensors", "gains.safetensors", "policy.safetensors")
    kept = {name: (out / name).read_bytes() for name in names}
    monkeypatch.setattr(command, "WEIGHTS_FOLDER", weights)
    main([*arguments, "--install"])
    assert {name: (out / name).read_bytes() for name in kept} == kept
    assert load_model(weights / "occant.safetensors").settings.width == 2
    assert json.loads((weights / "occant.json").read_text(encoding="utf-8"))["policy"] == report["policy"]


def test_without_anticipation_it_is_ans(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main([*TINY, "--no-anticipation", "--out", str(tmp_path)])
    assert "anticipated" not in capsys.readouterr().out
    report = json.loads((tmp_path / "ans.json").read_text(encoding="utf-8"))
    assert report["settings"]["reward"] == "area_seen"
    assert "anticipator" not in report
    model = load_model(tmp_path / "ans.safetensors")
    assert model.anticipator is None


def test_folder_of_another_run_is_refused(tmp_path: Path) -> None:
    (tmp_path / "settings.json").write_text("{}\n", encoding="utf-8")
    with pytest.raises(ValueError, match="`out` must be empty or hold a run with the same settings"):
        main([*TINY, "--out", str(tmp_path)])


def test_quick_run_keeps_what_is_given() -> None:
    assert training_of(read_options(["--quick"])) == OccAntTraining().quick()
    asked = training_of(read_options(["--quick", "--updates", "7", "--goal_homes=60", "--no-anticipation"]))
    assert (asked.goals.updates, asked.goal_homes, asked.reward) == (7, 60, "area_seen")
    assert asked.goals.envs == OccAntTraining().quick().goals.envs


def test_policy_that_nothing_would_be_taught_is_refused_before_the_folder_is_claimed(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="`updates` must be > 8, in which only the critic learns, got 8"):
        main(["--updates", "8", "--out", str(tmp_path / "run")])
    assert not (tmp_path / "run").exists()


def test_quick_run_has_a_folder_of_its_own_and_is_not_shipped() -> None:
    assert read_options(["--quick"]).out == "runs/occant-quick"
    assert read_options(["--quick", "--out", "mine"]).out == "mine"
    with pytest.raises(ValueError, match="`--install` must not come with `--quick`"):
        read_options(["--quick", "--install"])


def test_quick_run_is_small_and_of_the_same_kind() -> None:
    quick = OccAntTraining().quick()
    assert quick.frame_homes * quick.frames.frames_per_home <= 100
    assert quick.goals.updates * quick.goals.envs * quick.twin.goals <= 500
    assert quick.model.anticipates


def test_at_least_one_home_is_needed() -> None:
    with pytest.raises(ValueError, match="`frame_homes`, `test_homes`, `goal_homes` and `test_episodes`"):
        OccAntTraining(goal_homes=0)


def test_table_shows_coverage_by_steps() -> None:
    shares = [0.1 * goal for goal in range(13)]
    curve = [{"gain_m2": float(update)} for update in range(10)]
    text = format_coverage({"curve": curve, "coverage": {"policy": shares}, "steps_per_goal": 96})
    assert "0.5  2.5  4.5  6.5  8.5" in text
    header, row = (line.split() for line in text.splitlines()[-2:])
    assert header[-8:] == ["0", "192", "384", "576", "768", "960", "1152", "mean"]
    assert row == ["policy", "0.0", "20.0", "40.0", "60.0", "80.0", "100.0", "120.0", "60.0"]
