from dataclasses import replace

import pytest

from anm_gym.map.settings import (
    PRESETS,
    LossSettings,
    SamplingSettings,
    map_settings,
)


def test_every_preset_is_filed_under_its_name() -> None:
    assert set(PRESETS) == {"paper", "released", "fast", "best"}
    assert all(map_settings(name).preset == name for name in PRESETS)


def test_hash_names_the_effective_settings() -> None:
    settings = map_settings("paper")
    faster = replace(settings, schedule=replace(settings.schedule, iterations=3))
    assert settings.settings_hash == map_settings("paper").settings_hash
    assert len({settings.settings_hash, faster.settings_hash, map_settings("released").settings_hash}) == 3


def test_released_preset_differs_from_the_paper_where_the_code_does() -> None:
    paper, released = map_settings("paper"), map_settings("released")
    assert (paper.field.hidden_layers, released.field.hidden_layers) == (4, 6)
    assert (paper.variability.statistic, released.variability.statistic) == ("variance", "mean_absolute")
    assert released.schedule.iterations == 5
    assert released.sampling.samples_per_ray == 27


def test_bad_settings_are_refused() -> None:
    with pytest.raises(ValueError, match="unknown map preset 'quick'; choose one of: best, fast, paper"):
        map_settings("quick")
    with pytest.raises(ValueError, match="`window_frames` must be >= 3, got 2"):
        SamplingSettings(window_frames=2)
    with pytest.raises(ValueError, match="must be >= 1"):
        SamplingSettings(rays_per_frame=0)
    with pytest.raises(ValueError, match=r"`gradient_share` must be in \(0, 1\], got 0"):
        LossSettings(gradient_share=0.0)
