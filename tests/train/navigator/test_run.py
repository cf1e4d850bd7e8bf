"""The command: both stages in a folder, and on again after it was killed."""

import json
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file

from agents.navigator_net import NavigatorNetSettings
from agents.policy_file import load_policy
from train.navigator.dagger import DaggerSettings
from train.navigator.env import DomainSettings
from train.navigator.ppo import NavigatorPpo, PpoSettings
from train.navigator.presets import PRESETS, VARIANTS, NavigatorTraining, training_of
from train.navigator.run import DONE, IMITATION, REINFORCEMENT, NavigatorRun

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def training(tiny_net: NavigatorNetSettings) -> NavigatorTraining:
    """Give settings of a run of a few seconds."""
    return NavigatorTraining(
        net=tiny_net,
        domain=DomainSettings(tiers={"studio": 1.0}, max_steps=40),
        imitation=DaggerSettings(frames=256, segments=2, updates_per_rollout=1),
        reinforcement=PpoSettings(frames=256, rollout_steps=32, minibatches=1, value_frames=64),
        num_agents=2,
        evaluation_every=192,
        evaluation_episodes=1,
    )


def test_run_leaves_weights_card_log_and_curve(training: NavigatorTraining, tmp_path: Path) -> None:
    net = NavigatorRun(training, tmp_path).train()
    for name, values in load_policy(tmp_path / "policy.safetensors").state_dict().items():
        assert torch.equal(values, net.state_dict()[name])
    card = json.loads((tmp_path / "policy.json").read_text())
    assert [point["stage"] for point in card["curve"]] == [IMITATION, REINFORCEMENT]
    assert set(card["curve"][0]) >= {"frames", "success_0.065", "spl_0.25"}
    assert card["training"]["seed"] == 0
    header = (tmp_path / "log" / "imitation_0" / "progress.csv").read_text().splitlines()[0]
    assert {"rollout/success_rate", "train/loss"} <= set(header.split(","))


def test_run_goes_on_from_its_checkpoint(training: NavigatorTraining, tmp_path: Path, monkeypatch) -> None:
    """An error after the first stage stands for a kill; what was saved is not learned again."""
    monkeypatch.setattr("train.navigator.run.SAVE_S", -1.0)
    run, stages = NavigatorRun(training, tmp_path), []

    def crash(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "_reinforce", crash)
    with pytest.raises(KeyboardInterrupt):
        run.train()
    again = NavigatorRun(training, tmp_path)
    assert again.progress.frames == 256
    monkeypatch.setattr("train.navigator.run.Dagger.rounds", lambda _: stages.append("imitation") or iter(()))
    again.train()
    assert again.progress.stage == DONE
    assert stages == ["imitation"], "the stage is entered, and is over at once"


def test_kill_in_the_first_rollout_of_reinforcement_keeps_what_was_imitated(
    training: NavigatorTraining, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("train.navigator.run.SAVE_S", -1.0)

    def crash(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("train.navigator.run._Watch._on_step", crash)
        with pytest.raises(KeyboardInterrupt):
            NavigatorRun(training, tmp_path).train()
    kept = load_file(tmp_path / "checkpoint.safetensors")
    again, begun = NavigatorRun(training, tmp_path), {}
    assert (again.progress.stage, again.progress.frames) == (REINFORCEMENT, 0)

    def note(model: NavigatorPpo, *_: object, **__: object) -> None:
        begun.update({name: values.clone() for name, values in model.policy.state_dict().items()})
        raise KeyboardInterrupt

    monkeypatch.setattr("train.navigator.run.NavigatorPpo.learn", note)
    with pytest.raises(KeyboardInterrupt):
        again.train()
    assert all(torch.equal(values, kept[f"module/{name}"]) for name, values in begun.items())


def test_finished_run_is_read_and_not_done_again(training: NavigatorTraining, tmp_path: Path) -> None:
    net = NavigatorRun(training, tmp_path).train()
    before = (tmp_path / "policy.safetensors").stat().st_mtime_ns
    again = NavigatorRun(training, tmp_path).train()
    assert (tmp_path / "policy.safetensors").stat().st_mtime_ns == before
    assert all(torch.equal(values, net.state_dict()[name]) for name, values in again.state_dict().items())


@pytest.mark.slow
def test_killed_command_goes_on(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "train.navigator", "--quick", "--out", str(tmp_path), "--seed", "1"]
    process = subprocess.Popen(command, cwd=ROOT)
    deadline = time.monotonic() + 120.0
    while not (tmp_path / "settings.json").exists() and time.monotonic() < deadline:
        time.sleep(0.5)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not (tmp_path / "policy.safetensors").exists()
    subprocess.run(command, cwd=ROOT, check=True, timeout=240)
    assert (tmp_path / "policy.safetensors").exists()


def test_other_settings_are_refused_in_the_same_folder(training: NavigatorTraining, tmp_path: Path) -> None:
    NavigatorRun(training, tmp_path)
    with pytest.raises(ValueError, match="`out` must be empty or hold a run with the same settings"):
        NavigatorRun(replace(training, seed=1), tmp_path)


def test_presets_and_variants_are_chosen_by_name() -> None:
    training = training_of("mini", "star", imitation_frames=7, num_agents=4, seed=3)
    assert training.domain == VARIANTS["star"]
    assert (training.imitation.frames, training.num_agents, training.seed) == (7, 4, 3)
    assert training.reinforcement == PRESETS["mini"].reinforcement
    assert PRESETS["full"].net.vision == "resnet50"
    with pytest.raises(ValueError, match="unknown preset 'huge'; choose one of: mini, full, quick"):
        training_of("huge", "plus")
    with pytest.raises(ValueError, match="unknown variant 'moon'; choose one of: plus, star"):
        training_of("mini", "moon")
