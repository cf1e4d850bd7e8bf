"""The command: both stages in a folder, and on again after it was killed."""

import csv
import json
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from safetensors.torch import load_file

from agents.navigator_net import NavigatorNet, NavigatorNetSettings
from agents.policy_file import load_policy
from train.navigator.dagger import DaggerSettings
from train.navigator.env import DomainSettings
from train.navigator.hardware import Hardware
from train.navigator.ppo import NavigatorPpo, PpoSettings
from train.navigator.presets import NavigatorTraining
from train.navigator.ranks import Ranks
from train.navigator.run import DONE, IMITATION, REINFORCEMENT, NavigatorRun
from train.training_checkpoint import TrainingCheckpoint

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


@pytest.fixture
def unjudged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the episodes of evaluations out, which take longer than the training."""
    monkeypatch.setattr(NavigatorRun, "evaluate", lambda *_: {})


def test_run_leaves_weights_card_log_and_curve(training: NavigatorTraining, tmp_path: Path) -> None:
    net = NavigatorRun(training, tmp_path).train()
    for name, values in load_policy(tmp_path / "policy.safetensors").state_dict().items():
        assert torch.equal(values, net.state_dict()[name])
    card = json.loads((tmp_path / "policy.json").read_text())
    assert [(point["stage"], point["frames"]) for point in card["curve"]] == [
        (IMITATION, 192),
        (REINFORCEMENT, 192),
        (REINFORCEMENT, 256),
    ], "the network that is left is the last point of the curve"
    assert card["hardware"] == {"device": "cpu", "backend": "embree"}
    assert set(card["curve"][0]) >= {"frames", "success_0.065", "spl_0.25"}
    assert card["training"]["seed"] == 0
    header = (tmp_path / "log" / "imitation_0" / "progress.csv").read_text().splitlines()[0]
    assert {"rollout/success_rate", "train/loss", "time/total_timesteps"} <= set(header.split(","))
    with (tmp_path / "log" / "reinforcement_0" / "progress.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert {"rollout/spl", "rollout/success_rate", "train/value_loss"} <= rows[0].keys()
    judged = [row["time/total_timesteps"] for row in rows if row["eval/success_0.25"]]
    assert judged == ["192", "256"], "an evaluation stands where it was made"


def test_last_point_is_of_the_network_that_is_left(
    training: NavigatorTraining, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judged = []

    def judge(run: NavigatorRun, net: NavigatorNet) -> dict[str, float]:
        judged.append({name: values.clone() for name, values in net.state_dict().items()})
        return {"success_0.25": 0.5}

    monkeypatch.setattr(NavigatorRun, "evaluate", judge)
    NavigatorRun(training, tmp_path).train()
    left = load_policy(tmp_path / "policy.safetensors").state_dict()
    assert all(torch.equal(values, left[name]) for name, values in judged[-1].items())
    log = (tmp_path / "log" / "imitation_0" / "progress.csv").read_text().splitlines()
    assert "eval/success_0.25" in log[0].split(",")


@pytest.mark.usefixtures("unjudged")
@pytest.mark.parametrize("every", [10_000, 128])
def test_imitation_alone_is_judged_once_at_its_end(
    training: NavigatorTraining, tmp_path: Path, every: int
) -> None:
    alone = replace(training.reinforcement, frames=0)
    NavigatorRun(replace(training, reinforcement=alone, evaluation_every=every), tmp_path).train()
    curve = json.loads((tmp_path / "policy.json").read_text())["curve"]
    assert [point["frames"] for point in curve] == ([256] if every > 256 else [128, 256])
    assert {point["stage"] for point in curve} == {IMITATION}


def test_processes_that_leave_the_actor_no_rollout_claim_no_folder(
    training: NavigatorTraining, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=r"`reinforcement\.frames` must leave a rollout for the actor"):
        NavigatorRun(training, tmp_path / "run", Ranks(0, 4))
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("domain", "message"),
    [
        (
            {"forward_step_m": (0.25,), "sensor_height_m": (1.25, 9.0)},
            "`sensor_height_m` must be below the ceiling",
        ),
        ({"forward_step_m": (300.0,)}, "`max_episode_steps` must be"),
    ],
)
def test_settings_that_cannot_work_claim_no_folder(
    training: NavigatorTraining, tmp_path: Path, domain: dict[str, Any], message: str
) -> None:
    hopeless = replace(training, domain=replace(training.domain, **domain))
    with pytest.raises(ValueError, match=message):
        NavigatorRun(hopeless, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_folder_goes_on_on_other_hardware(training: NavigatorTraining, tmp_path: Path) -> None:
    NavigatorRun(training, tmp_path)
    run = NavigatorRun(training, tmp_path, hardware=Hardware(backend="warp"))
    assert run.hardware.camera_device == "cpu"


@pytest.mark.gpu
def test_run_learns_on_a_gpu(training: NavigatorTraining, tmp_path: Path) -> None:
    net = NavigatorRun(training, tmp_path, hardware=Hardware("cuda")).train()
    assert next(net.parameters()).device.type == "cpu"
    assert len(json.loads((tmp_path / "policy.json").read_text())["curve"]) == 3


@pytest.mark.usefixtures("unjudged")
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


@pytest.mark.usefixtures("unjudged")
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
    assert all(torch.equal(values, kept[f"module.{name}"]) for name, values in begun.items())


@pytest.mark.usefixtures("unjudged")
def test_finished_run_is_read_and_not_done_again(training: NavigatorTraining, tmp_path: Path) -> None:
    net = NavigatorRun(training, tmp_path).train()
    before = (tmp_path / "policy.safetensors").stat().st_mtime_ns
    again = NavigatorRun(training, tmp_path).train()
    assert (tmp_path / "policy.safetensors").stat().st_mtime_ns == before
    assert all(torch.equal(values, net.state_dict()[name]) for name, values in again.state_dict().items())


@pytest.mark.slow
def test_killed_command_goes_on_from_its_checkpoint(tmp_path: Path) -> None:
    often = "import train.navigator.run as run; run.SAVE_S = 0.0; run.EVALUATION_HOMES = ('home:studio:900',)"
    script = f"{often}; from train.navigator.__main__ import main; main()"
    budget = ["--quick", "--imitation-frames", "1024", "--reinforcement-frames", "0"]
    small = ["--domain.tiers", '{"studio": 1.0}', "--evaluation-every", "1000000"]
    command = [sys.executable, "-c", script, *budget, *small, "--out", str(tmp_path), "--seed", "1"]
    process = subprocess.Popen(command, cwd=ROOT)
    deadline = time.monotonic() + 60.0
    while not (tmp_path / "checkpoint.safetensors").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not (tmp_path / "policy.safetensors").exists()
    kept = TrainingCheckpoint(tmp_path / "checkpoint.safetensors").progress()
    assert kept is not None
    assert 0 < kept.frames < 1024
    subprocess.run(command, cwd=ROOT, check=True, timeout=120)
    logs = {path.name for path in (tmp_path / "log").iterdir()}
    assert logs == {"imitation_0", f"imitation_{kept.frames}"}, "the second start begins where the first was"
    rows = (tmp_path / "log" / f"imitation_{kept.frames}" / "progress.csv").read_text().splitlines()
    assert len(rows) - 1 <= (1024 - kept.frames) // 256 + 1, "what was kept is not learned again"
    assert (tmp_path / "policy.safetensors").exists()


def test_other_settings_are_refused_in_the_same_folder(training: NavigatorTraining, tmp_path: Path) -> None:
    NavigatorRun(training, tmp_path)
    with pytest.raises(ValueError, match="`out` must be empty or hold a run with the same settings"):
        NavigatorRun(replace(training, seed=1), tmp_path)
