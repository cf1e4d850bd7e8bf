"""The command's options: settings from YAML and flags, two modes that do not mix."""

import json
from dataclasses import asdict
from pathlib import Path

import pytest

from agents.navigator_net import NavigatorNetSettings
from train.navigator import __main__ as command
from train.navigator.__main__ import main, read_options, training_from
from train.navigator.hardware import Hardware
from train.navigator.ppo import PpoSettings
from train.navigator.presets import VARIANTS, NavigatorTraining, training_of

ROOT = Path(__file__).resolve().parents[3]


def training(*arguments: str) -> NavigatorTraining:
    return training_from(*read_options(arguments))


def test_shipped_configuration_is_the_shipped_navigators() -> None:
    path = ROOT / "configs" / "navigator.yaml"
    read = training("--config", str(path))
    assert read == training_of("mini", "plus", num_agents=16)
    shipped = json.loads((ROOT / "agents" / "weights" / "ddppo-plus.json").read_text())["training"]
    shipped["reinforcement"] = asdict(PpoSettings(**shipped["reinforcement"]))  # fields have been added
    plain = json.loads(json.dumps(read.as_dict()))
    assert NavigatorNetSettings.read(shipped.pop("net")) == NavigatorNetSettings.read(plain.pop("net"))
    assert shipped == plain


def test_yaml_reaches_every_field_and_flags_come_after(tmp_path: Path) -> None:
    path = tmp_path / "navigator.yaml"
    path.write_text(
        "preset: quick\nagents: 4\n"
        "domain: {tiers: {flat: 1}, forward_step_m: [0.1]}\n"
        "reinforcement: {learning_rate: 1.0e-3, rollout_steps: 16}\n"
    )
    got = training("--config", str(path), "--reinforcement.learning-rate", "2e-3", "--net.image_px", "48")
    assert (got.reinforcement.learning_rate, got.reinforcement.rollout_steps) == (2e-3, 16)
    assert (got.domain.tiers, got.domain.forward_step_m) == ({"flat": 1.0}, (0.1,))
    assert (got.net.image_px, got.num_agents, got.evaluation_every) == (48, 4, 1_024)


def test_flags_of_old_go_on_to_work() -> None:
    old = ["--variant", "star", "--imitation-frames", "7", "--reinforcement-frames", "200000", "--seed", "3"]
    got = training("--preset", "mini", "--agents", "4", *old)
    frames = {"imitation_frames": 7, "reinforcement_frames": 200_000}
    assert got == training_of("mini", "star", num_agents=4, seed=3, **frames)
    assert training("--quick").num_agents == 8
    assert training().domain == VARIANTS["plus"]


def test_quick_run_has_a_folder_of_its_own_unless_one_is_given() -> None:
    folders = [
        read_options(words)[0]["out"]
        for words in ([], ["--quick"], ["--quick", "--evaluate"], ["--quick", "--out", "mine"])
    ]
    assert folders == ["runs/navigator", "runs/navigator-quick", "runs/navigator-quick", "mine"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--evaluate", "--seed", "1"], "--evaluate must come without options of training, got --seed"),
        (["--evaluate", "--net.image-px", "48"], "without options of training, got --net; leave them out"),
        (["--evaluate", "--imitation-frames", "1"], "got --imitation-frames; leave them out"),
        (["--json", "x", "--step-m", "0.1"], "comparison, got --json, --step-m; add --evaluate"),
        (["--argmax", "--navigators", "oracle"], "comparison, got --argmax, --navigators; add --evaluate"),
        (["--scenes", "home:flat:1", "--episodes", "3"], "got --scenes, --episodes; add --evaluate"),
        (["--quick", "--preset", "full"], "--quick must not come with another preset, got --preset full"),
    ],
)
def test_options_that_would_do_nothing_are_refused(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--agents", "6"], "`num_agents` must be a multiple of `reinforcement.minibatches`, got 6 and 4"),
        (["--agents", "0"], "`num_agents` must be >= 1, got 0"),
        (["--imitation-frames", "-5"], "`frames` must be >= 0, got -5"),
        (["--reinforcement-frames", "40000"], "`reinforcement.frames` must leave a rollout for the actor"),
        (["--device", "abacus"], "`device` must be one that torch knows"),
        (["--backend", "pencil"], "unknown backend 'pencil'; choose one of: embree, warp"),
    ],
)
def test_refused_settings_claim_no_folder(arguments: list[str], message: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=message):
        main([*arguments, "--out", str(tmp_path / "run")])
    assert not (tmp_path / "run").exists()


def test_missing_gpu_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    with pytest.raises(ValueError, match="`device` must be one of this machine's, got 'cuda' without a CUDA"):
        main(["--device", "cuda", "--out", str(tmp_path / "run")])
    assert not (tmp_path / "run").exists()


def test_warp_casts_rays_on_the_device_and_embree_on_the_cpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: True)
    monkeypatch.setattr("torch.cuda.device_count", lambda: 1)
    assert Hardware("cuda", "warp").camera_device == "cuda"
    assert Hardware("cuda", "embree").camera_device == "cpu"


def test_processes_of_a_machine_have_a_gpu_each(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("train.navigator.hardware.usable_device", lambda device: device)
    assert Hardware("cuda").of_process().device == "cuda"
    monkeypatch.setenv("WORLD_SIZE", "2")
    monkeypatch.setenv("LOCAL_RANK", "1")
    assert Hardware("cuda", "warp").of_process() == Hardware("cuda:1", "warp")
    assert Hardware("cuda:0").of_process().device == "cuda:0"
    assert Hardware().of_process().device == "cpu"


@pytest.mark.parametrize("name", ["navigators", "scenes"])
def test_comparison_of_nothing_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"`{name}` must name at least one, got none"):
        main(["--evaluate", f"--{name}", ""])


@pytest.mark.parametrize(
    ("arguments", "episodes"),
    [(["--quick"], 9), (["--quick", "--episodes", "18"], 18), (["--episodes", "12"], 12), ([], 100)],
)
def test_quick_comparison_plays_every_scene(
    arguments: list[str], episodes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    monkeypatch.setattr(command, "compare_navigators", lambda comparison, json_path: asked.append(comparison))
    scenes = ",".join(f"home:studio:{seed}" for seed in range(9))
    main(["--evaluate", "--navigators", "oracle", "--scenes", scenes, *arguments])
    assert asked[0].episodes == episodes
