import json
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor, nn

import train.upen.__main__ as command
from agents.upen_ensemble import SCORES, Ensemble, EnsembleSettings, load_ensemble
from train.upen import data as upen_data
from train.upen.__main__ import UpenTraining, main, read_options, training_of
from train.upen.data import Crops
from train.upen.learning import LearningSettings
from train.upen.scores import evaluate, format_scores

TINY = ["--homes", "2", "--test_homes", "1", "--crops_per_home", "4", "--width", "8", "--members", "2"]
TINY += ["--passes", "32"]


class Says(nn.Module):
    """A network that gives the same logits for every cell."""

    def __init__(self, *logits: float) -> None:
        super().__init__()
        self.logits = torch.tensor(logits, dtype=torch.float32)

    def forward(self, raster: Tensor) -> Tensor:
        return self.logits[:, None, None].expand(len(raster), 3, *raster.shape[2:])


@pytest.fixture
def crops() -> Crops:
    """Give squares whose left half was seen as it is, free, and whose right half is occupied and unseen."""
    labels = np.full((4, 16, 16), 2, np.uint8)
    labels[:, :, 8:] = 1
    inputs = np.full((4, 3, 16, 16), 85, np.uint8)
    inputs[:, :, :, :8] = np.array([0, 0, 255], np.uint8)[:, None, None]
    return Crops(inputs, labels)


def test_scores_know_seen_cells_from_unseen_ones(crops: Crops) -> None:
    settings = EnsembleSettings(members=2, crop_cells=16)
    scores = evaluate(Ensemble(settings, [Says(0, 5, 0), Says(0, 5, 0)]), crops, majority=2, seed=0)
    assert scores["iou"]["observed only"]["all"]["free"] == 1.0
    assert scores["iou"]["observed only"]["unobserved"]["occupied"] == 0.0
    assert scores["iou"]["observed, else majority"]["all"]["free"] == pytest.approx(0.5)
    assert scores["iou"]["ensemble"]["unobserved"]["occupied"] == 1.0
    assert scores["iou"]["ensemble"]["all"]["accuracy"] == pytest.approx(0.5)


def test_doubt_where_the_ensemble_is_wrong_ranks_first(crops: Crops) -> None:
    class Split(nn.Module):
        """Sure of the unseen right half, divided about the left, and wrong there."""

        def __init__(self, label: int) -> None:
            super().__init__()
            self.label = label

        def forward(self, raster: Tensor) -> Tensor:
            logits = torch.zeros(len(raster), 3, 16, 16)
            logits[:, 1, :, 8:] = 9.0
            logits[:, self.label, :, :8] = 2.0
            return logits

    settings = EnsembleSettings(members=2, crop_cells=16)
    scores = evaluate(Ensemble(settings, [Split(0), Split(1)]), crops, majority=2, seed=0)
    assert [scores["auroc"]["all"][score] for score in SCORES] == pytest.approx([1.0] * 4)
    assert "ensemble" in format_scores(scores)


@pytest.fixture
def small_homes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every home be a studio."""
    monkeypatch.setattr(upen_data, "TIERS", ("studio",))


@pytest.mark.usefixtures("small_homes")
def test_command_trains_writes_goes_on_and_ships(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "run"
    arguments = [*TINY, "--out", str(out), "--json", str(tmp_path / "report.json")]
    main(arguments)
    printed = capsys.readouterr().out
    assert "observed, else majority" in printed
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert report["settings"]["raster"]["width"] == 8
    assert len(report["curves"]) == 2
    assert report["cpu_s"] > 0.0
    assert set(report["scores"]["auroc"]["unobserved"]) == set(SCORES)
    assert load_ensemble(out / "upen.safetensors").settings.members == 2
    kept = (out / "members" / "0.safetensors").read_bytes()
    monkeypatch.setattr(command, "SHIPPED", tmp_path / "weights" / "upen.safetensors")
    main([*arguments, "--install"])
    assert (out / "members" / "0.safetensors").read_bytes() == kept
    shipped, made = (load_ensemble(folder / "upen.safetensors") for folder in (tmp_path / "weights", out))
    assert shipped.identity == made.identity
    again = json.loads((tmp_path / "weights" / "upen.json").read_text(encoding="utf-8"))
    assert again["cpu_s"] > report["cpu_s"], "the time of the first start counts"


def test_folder_of_another_run_is_refused(tmp_path: Path) -> None:
    (tmp_path / "settings.json").write_text("{}\n", encoding="utf-8")
    with pytest.raises(ValueError, match="`out` must be empty or hold a run with the same settings"):
        main([*TINY, "--out", str(tmp_path)])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--net", "foo"], "`net` must be one of plain, residual, got 'foo'"),
        (["--width", "0"], "`width` must be >= 1, got 0"),
    ],
)
def test_wrong_network_is_refused_before_it_claims_the_folder(
    given: list[str], message: str, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=message):
        main([*TINY, *given, "--out", str(tmp_path / "run")])
    assert not (tmp_path / "run").exists()


def test_quick_run_keeps_what_is_given() -> None:
    assert training_of(read_options(["--quick"])) == UpenTraining().quick()
    asked = training_of(read_options(["--quick", "--width", "9", "--homes=2", "--passes", "20000"]))
    assert (asked.raster.width, asked.homes, asked.learning.passes) == (9, 2, 20_000)
    assert asked.test_homes == UpenTraining().quick().test_homes


def test_quick_run_has_a_folder_of_its_own_and_is_not_shipped() -> None:
    assert (read_options([]).out, read_options(["--quick"]).out) == ("runs/upen", "runs/upen-quick")
    with pytest.raises(ValueError, match="`--install` must not come with `--quick`"):
        read_options(["--quick", "--install"])


def test_quick_run_is_small() -> None:
    quick = UpenTraining().quick()
    assert quick.homes * quick.crops.crops_per_home <= 100
    assert quick.learning.passes <= 1000


def test_disjoint_split_needs_a_home_for_each_member() -> None:
    with pytest.raises(ValueError, match="`homes` must be >= `members` for disjoint splits, got 3 and 4"):
        UpenTraining(homes=3, learning=LearningSettings(split="disjoint"))


def test_at_least_one_home_is_needed() -> None:
    with pytest.raises(ValueError, match="`homes` and `test_homes` must be >= 1, got 0 and 16"):
        UpenTraining(homes=0)
