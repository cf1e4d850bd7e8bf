from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from agents.layout_memory import VIEW_CHANNELS, LayoutSettings
from agents.occant_model import (
    FORMAT,
    Anticipator,
    OccAntModel,
    OccAntSettings,
    load_model,
    new_anticipator_net,
    new_goal_net,
    save_model,
)
from anm_gym.errors import PolicyError

SMALL = OccAntSettings(width=2, layout=LayoutSettings(view_cells=16))


def model_of(settings: OccAntSettings) -> OccAntModel:
    anticipator = Anticipator(new_anticipator_net(settings, 1)) if settings.anticipates else None
    return OccAntModel(settings, new_goal_net(settings, 1), anticipator)


@pytest.mark.parametrize("anticipates", [True, False])
def test_saved_model_scores_as_before(tmp_path: Path, rng: np.random.Generator, anticipates: bool) -> None:
    model = model_of(replace(SMALL, anticipates=anticipates))
    save_model(model, tmp_path / "model.safetensors")
    loaded = load_model(tmp_path / "model.safetensors")
    assert loaded.settings == model.settings
    view = rng.random((VIEW_CHANNELS, 16, 16), np.float32)
    # Weights keep 16 bits.
    assert loaded.score_goals(view) == pytest.approx(model.score_goals(view), abs=1e-2)
    if model.anticipator is not None and loaded.anticipator is not None:
        look = (rng.random((1, 2, 64, 64)) < 0.3).astype(np.float32)
        assert loaded.anticipator(look) == pytest.approx(model.anticipator(look), abs=1e-2)


def test_scores_are_log_probabilities(rng: np.random.Generator) -> None:
    scores = model_of(SMALL).score_goals(rng.random((VIEW_CHANNELS, 16, 16), np.float32))
    assert np.exp(scores).sum() == pytest.approx(1.0, abs=1e-5)


def test_anticipation_gives_probabilities(rng: np.random.Generator) -> None:
    look = (rng.random((2, 2, 64, 64)) < 0.3).astype(np.float32)
    completed = Anticipator(new_anticipator_net(SMALL, 0))(look)
    assert completed.shape == look.shape
    assert (completed > 0.0).all()
    assert (completed < 1.0).all()


def test_same_seed_gives_the_same_weights_and_leaves_the_global_seed_alone() -> None:
    torch.manual_seed(5)
    expected = torch.rand(1)
    torch.manual_seed(5)
    first, second = (new_goal_net(SMALL, 3).state_dict() for _ in range(2))
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert torch.equal(torch.rand(1), expected)


def test_missing_model_tells_how_to_train_one(tmp_path: Path) -> None:
    with pytest.raises(PolicyError, match=r"`name_or_path` must name a saved model, got .*train.occant"):
        load_model(tmp_path / "none.safetensors")


def test_file_of_another_format_is_refused(tmp_path: Path) -> None:
    save_file({"x": torch.zeros(1)}, tmp_path / "other.safetensors", metadata={"format": "other"})
    with pytest.raises(PolicyError, match=f"a model must have format '{FORMAT.name}', got 'other'"):
        load_model(tmp_path / "other.safetensors")


def test_file_that_does_not_fit_its_settings_is_refused(tmp_path: Path) -> None:
    save_model(model_of(replace(SMALL, anticipates=False)), tmp_path / "model.safetensors")
    wrong = OccAntModel(
        replace(SMALL, anticipates=False), new_goal_net(OccAntSettings(), 0), anticipator=None
    )
    wrong.settings = replace(SMALL, anticipates=False, width=3)
    wrong.goal_net = torch.nn.Linear(2, 2)  # type: ignore[assignment]
    save_model(wrong, tmp_path / "wrong.safetensors")
    with pytest.raises(PolicyError, match=r"the model in .* must fit its settings"):
        load_model(tmp_path / "wrong.safetensors")


def test_settings_and_anticipator_must_agree() -> None:
    with pytest.raises(ValueError, match="`anticipator` must be given if and only if"):
        OccAntModel(SMALL, new_goal_net(SMALL, 0), None)
    with pytest.raises(ValueError, match="`width` must be >= 1, got 0"):
        OccAntSettings(width=0)
