from pathlib import Path

import numpy as np
import pytest
import torch

from agents.layout_memory import EXPLORED, OCCUPIED
from agents.occant_model import Anticipator, OccAntSettings
from train.occant.anticipator import (
    AnticipatorLearner,
    AnticipatorLearning,
    format_anticipation,
    score_anticipator,
)
from train.occant.frames import Frames

MODEL = OccAntSettings(width=2)


@pytest.fixture
def frames(rng: np.random.Generator) -> Frames:
    """Give squares of floor with a wall; looks show their left half."""
    labels = np.zeros((12, 2, 64, 64), bool)
    for label, size in zip(labels, rng.integers(10, 30, 12), strict=True):
        label[EXPLORED, 63 - size :, 32 - size : 32 + size] = True
        label[OCCUPIED, 63 - size, 32 - size : 32 + size] = True
    looks = labels.copy()
    looks[..., 32:] = False
    return Frames(looks, labels)


class Repeats(torch.nn.Module):
    """Answer with the mirror image added: right for these frames."""

    def forward(self, raster: torch.Tensor) -> torch.Tensor:
        return 20.0 * (raster + raster.flip(3)) - 10.0


def test_scores_of_right_and_of_no_anticipation(frames: Frames) -> None:
    scores = score_anticipator(Anticipator(Repeats()), frames)
    assert scores["anticipated"]["revealed"]["free"] == {"f1": 1.0, "iou": 1.0}
    assert scores["anticipated"]["unseen"]["occupied"] == {"f1": 1.0, "iou": 1.0}
    assert scores["seen only"]["revealed"]["free"]["iou"] == pytest.approx(0.5)
    assert scores["seen only"]["revealed"]["free"]["f1"] == pytest.approx(2 / 3)
    assert scores["seen only"]["unseen"]["free"]["f1"] == 0.0
    assert scores["seen only"]["explored_iou"] == pytest.approx(0.5)
    assert "anticipated" in format_anticipation(scores)


def test_loss_falls(frames: Frames) -> None:
    learner = AnticipatorLearner(MODEL, AnticipatorLearning(passes=160, batch=8, mirrors=False), seed=0)
    losses = list(learner.learn(frames))
    assert len(losses) == 20
    assert np.mean(losses[-4:]) < 0.93 * np.mean(losses[:4])
    assert len(learner.curve) == 1


def test_killed_learner_goes_on_bit_for_bit(tmp_path: Path, frames: Frames) -> None:
    settings = AnticipatorLearning(passes=24, batch=4)
    whole = AnticipatorLearner(MODEL, settings, seed=0)
    expected = list(whole.learn(frames))
    first = AnticipatorLearner(MODEL, settings, seed=0)
    steps = first.learn(frames)
    assert [next(steps) for _ in range(3)] == expected[:3]
    first.save(tmp_path / "a.safetensors")
    second = AnticipatorLearner(MODEL, settings, seed=0)
    second.load(tmp_path / "a.safetensors")
    assert list(second.learn(frames)) == expected[3:]
    assert second.curve == whole.curve


def test_learning_needs_frames() -> None:
    with pytest.raises(ValueError, match="`passes` must be >= 1, got 0"):
        AnticipatorLearning(passes=0)
