import pytest

from anm_gym.map.presets import PRESETS, map_settings


def test_presets_are_filed_under_their_names() -> None:
    assert {name: map_settings(name).preset for name in PRESETS} == {name: name for name in PRESETS}


def test_variants_change_what_they_name_and_the_hash() -> None:
    plain, dropping = map_settings("best"), map_settings("best+dropout")
    assert dropping.field.dropout == 0.05
    assert dropping.variability.family == "dropout"
    assert dropping.variability.draws == 5
    assert dropping.settings_hash != plain.settings_hash
    relu = map_settings("paper+relu+unit_norm")
    assert (relu.field.activation, relu.field.encoding, relu.variability.family) == (
        "relu", "axes", "unit_norm",
    )  # fmt: skip
    assert relu.preset == "paper+relu+unit_norm"
    assert map_settings("best+no_replay").sampling.replay == "none"
    assert map_settings("best+uniform_replay").sampling.replay == "uniform"


def test_unknown_names_are_refused_with_the_choices() -> None:
    with pytest.raises(
        ValueError, match="unknown map preset 'slow'; choose one of: paper, released, fast, best"
    ):
        map_settings("slow")
    with pytest.raises(ValueError, match="unknown variant 'gelu'; choose one of: unit_norm, delta_norm"):
        map_settings("best+gelu")
