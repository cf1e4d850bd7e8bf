import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from agents.upen_ensemble import (
    SCORES,
    SHIPPED,
    Ensemble,
    EnsembleSettings,
    doubt,
    load_ensemble,
    new_net,
    save_ensemble,
)
from anm_gym.errors import PolicyError
from anm_gym.map.projection import OCCUPIED

SMALL = EnsembleSettings(width=8, members=2, crop_cells=32)


@pytest.fixture
def ensemble() -> Ensemble:
    return Ensemble(SMALL, [new_net(SMALL, seed) for seed in range(SMALL.members)])


def crop(rng: np.random.Generator) -> np.ndarray:
    values = rng.random((3, 32, 32), dtype=np.float32)
    return values / values.sum(axis=0)


def test_members_give_probabilities_and_differ(ensemble: Ensemble, rng: np.random.Generator) -> None:
    predicted = ensemble.predict(crop(rng))
    assert predicted.shape == (2, 3, 32, 32)
    assert predicted.sum(axis=1) == pytest.approx(1.0, abs=1e-5)
    assert np.abs(predicted[0] - predicted[1]).max() > 0.01


def test_one_square_is_a_batch_of_one(ensemble: Ensemble, rng: np.random.Generator) -> None:
    squares = np.stack([crop(rng) for _ in range(3)])
    batch = ensemble.predict_batch(torch.from_numpy(squares)).numpy()
    assert ensemble.predict(squares[1]) == pytest.approx(batch[:, 1], abs=1e-5)


@pytest.mark.parametrize("score", SCORES)
def test_members_that_agree_and_are_sure_do_not_doubt(score) -> None:
    sure = np.zeros((3, 3, 4, 4), np.float32)
    sure[:, OCCUPIED] = 1.0
    assert doubt(sure, score) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("score", SCORES)
def test_members_that_contradict_each_other_doubt(score) -> None:
    split = np.zeros((2, 3, 1), np.float32)
    split[0, OCCUPIED] = split[1, 2] = 1.0
    expected = {"var_occ": 0.25, "var_sum": 0.5, "entropy": np.log(2.0), "mutual_info": np.log(2.0)}
    assert doubt(split, score)[0] == pytest.approx(expected[score])


def test_members_that_are_equally_unsure_only_have_entropy() -> None:
    unsure = np.full((4, 3, 1), 1.0 / 3.0, np.float32)
    assert doubt(unsure, "entropy")[0] == pytest.approx(np.log(3.0))
    assert [float(doubt(unsure, s)[0]) for s in ("var_occ", "var_sum", "mutual_info")] == pytest.approx(
        [0, 0, 0]
    )


def test_saved_ensemble_predicts_the_same(
    ensemble: Ensemble, tmp_path: Path, rng: np.random.Generator
) -> None:
    save_ensemble(ensemble, tmp_path / "whole.safetensors")
    loaded, square = load_ensemble(tmp_path / "whole.safetensors"), crop(rng)
    assert loaded.settings == SMALL
    assert loaded.identity == ensemble.identity
    assert (loaded.predict(square) == ensemble.predict(square)).all()


def test_half_the_bits_hardly_change_a_prediction(
    ensemble: Ensemble, tmp_path: Path, rng: np.random.Generator
) -> None:
    save_ensemble(ensemble, tmp_path / "whole.safetensors")
    save_ensemble(ensemble, tmp_path / "half.safetensors", is_half=True)
    sizes = [(tmp_path / f"{name}.safetensors").stat().st_size for name in ("whole", "half")]
    assert sizes[1] < 0.65 * sizes[0]
    half, square = load_ensemble(tmp_path / "half.safetensors"), crop(rng)
    assert half.predict(square) == pytest.approx(ensemble.predict(square), abs=5e-3)
    assert half.identity != ensemble.identity


def test_seed_makes_the_weights_and_leaves_the_global_generator_alone() -> None:
    before = torch.get_rng_state()
    first, second = (new_net(SMALL, 3).state_dict() for _ in range(2))
    assert all((first[name] == second[name]).all() for name in first)
    assert (torch.get_rng_state() == before).all()


def test_shipped_ensemble_is_small_and_says_how_it_was_made() -> None:
    assert SHIPPED.stat().st_size < 2_000_000
    report = json.loads(SHIPPED.with_suffix(".json").read_text(encoding="utf-8"))
    assert {"settings", "curves", "scores"} <= set(report)
    assert EnsembleSettings.read(report["settings"]["raster"]) == load_ensemble().settings


def test_missing_file_names_the_command(tmp_path: Path) -> None:
    with pytest.raises(PolicyError, match=r"`path` must name a saved ensemble, .*; train one with"):
        load_ensemble(tmp_path / "none.safetensors")


def test_file_of_another_format_is_refused(tmp_path: Path) -> None:
    save_file({"a": torch.zeros(1)}, tmp_path / "other.safetensors", metadata={"format": "other"})
    with pytest.raises(PolicyError, match=r"an ensemble must have format 'anm_gym\.upen\.1', got 'other'"):
        load_ensemble(tmp_path / "other.safetensors")


def test_file_that_does_not_fit_its_settings_is_refused(ensemble: Ensemble, tmp_path: Path) -> None:
    ensemble.settings = replace(SMALL, width=12)
    save_ensemble(ensemble, tmp_path / "odd.safetensors")
    with pytest.raises(PolicyError, match=r"the ensemble in .* must fit its settings"):
        load_ensemble(tmp_path / "odd.safetensors")


def test_wrong_number_of_networks_is_refused() -> None:
    with pytest.raises(ValueError, match="`nets` must hold 2 networks, got 1"):
        Ensemble(SMALL, [new_net(SMALL, 0)])


def test_unknown_score_lists_the_choices() -> None:
    with pytest.raises(ValueError, match="`score` must be one of var_occ, var_sum, entropy, mutual_info"):
        doubt(np.zeros((2, 3, 1), np.float32), "std")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"net": "foo"}, "`net` must be one of plain, residual, got 'foo'"),
        ({"width": 0}, "`width` must be >= 1, got 0"),
        ({"members": 0}, "`members` must be >= 1, got 0"),
        ({"cell_m": 0.0}, r"`cell_m` must be > 0, got 0\.0"),
    ],
)
def test_senseless_settings_are_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        EnsembleSettings(**options)
