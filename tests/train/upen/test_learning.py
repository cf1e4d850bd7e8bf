from pathlib import Path

import numpy as np
import pytest

from agents.upen_ensemble import EnsembleSettings
from train.upen.data import Crops
from train.upen.learning import LearningSettings, MemberLearner, homes_of_member

RASTER = EnsembleSettings(width=8, members=3, crop_cells=32)
SHORT = LearningSettings(passes=48, batch=4)


@pytest.fixture(scope="module")
def crops() -> Crops:
    """Give squares that are free in one half and void in the other, and seen as they are."""
    rng = np.random.default_rng(0)
    labels = np.where(rng.random((24, 1, 32)) < 0.5, 2, 0).astype(np.uint8).repeat(32, axis=1)
    inputs = (255 * (labels[:, None] == np.arange(3)[:, None, None])).astype(np.uint8)
    return Crops(inputs, labels)


def weights(learner: MemberLearner) -> np.ndarray:
    return np.concatenate([value.detach().numpy().ravel() for value in learner.net.parameters()])


def test_loss_falls(crops: Crops) -> None:
    learner = MemberLearner(
        RASTER, LearningSettings(passes=400, batch=8, learning_rate=1e-2), seed=0, member=0
    )
    losses = list(learner.learn(crops))
    assert len(losses) == 50
    assert np.mean(losses[-10:]) < 0.8 * np.mean(losses[:10])
    assert len(learner.curve) == 1


def test_interrupted_member_ends_as_one_that_was_not(crops: Crops, tmp_path: Path) -> None:
    whole = MemberLearner(RASTER, SHORT, seed=0, member=1)
    list(whole.learn(crops))
    first = MemberLearner(RASTER, SHORT, seed=0, member=1)
    for _, _loss in zip(range(5), first.learn(crops), strict=False):
        pass
    first.save(tmp_path / "member.safetensors")
    second = MemberLearner(RASTER, SHORT, seed=0, member=1)
    second.load(tmp_path / "member.safetensors")
    assert second.num_done == 5
    list(second.learn(crops))
    assert second.curve == pytest.approx(whole.curve)
    assert (weights(second) == weights(whole)).all()


def test_finished_member_learns_no_more(crops: Crops, tmp_path: Path) -> None:
    learner = MemberLearner(RASTER, SHORT, seed=0, member=0)
    list(learner.learn(crops))
    learner.save(tmp_path / "member.safetensors")
    again = MemberLearner(RASTER, SHORT, seed=0, member=0)
    again.load(tmp_path / "member.safetensors")
    assert list(again.learn(crops)) == []


def test_untrained_member_can_be_saved(tmp_path: Path) -> None:
    learner = MemberLearner(RASTER, SHORT, seed=0, member=0)
    learner.save(tmp_path / "member.safetensors")
    other = MemberLearner(RASTER, SHORT, seed=1, member=0)
    other.load(tmp_path / "member.safetensors")
    assert (weights(other) == weights(learner)).all()


def test_members_start_from_different_weights() -> None:
    first, second = (MemberLearner(RASTER, SHORT, seed=0, member=member) for member in (0, 1))
    assert (weights(first) != weights(second)).any()


def test_mirrored_batch_keeps_inputs_and_labels_together(crops: Crops) -> None:
    inputs, labels = MemberLearner(RASTER, SHORT, seed=0, member=0)._draw(crops)
    assert (inputs.argmax(dim=1) == labels).all()
    assert inputs.shape == (4, 3, 32, 32)


def test_learning_rate_falls_to_its_last_share() -> None:
    learner = MemberLearner(RASTER, SHORT, seed=0, member=0)
    learner.num_done = SHORT.num_batches
    learner._set_learning_rate()
    assert learner.optimizer.param_groups[0]["lr"] == pytest.approx(2e-5)


def test_disjoint_members_share_no_home() -> None:
    settings = LearningSettings(split="disjoint")
    parts = [homes_of_member(10, member, 3, settings, seed=0) for member in range(3)]
    assert sorted(np.concatenate(parts).tolist()) == list(range(10))


def test_overlapping_members_learn_from_seventy_per_cent_each() -> None:
    parts = [homes_of_member(100, member, 4, LearningSettings(), seed=0) for member in range(4)]
    assert [len(set(part.tolist())) for part in parts] == [70] * 4
    assert 35 < len(set(parts[0].tolist()) & set(parts[1].tolist())) < 63


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"passes": 0}, "`passes` must be >= 1, got 0"),
        ({"share": 0.0}, r"`share` must be in \(0, 1\], got 0\.0"),
    ],
)
def test_senseless_settings_are_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        LearningSettings(**options)  # type: ignore[arg-type]
