import math
from dataclasses import replace
from functools import partial
from typing import Any

import pytest

from anm_gym.map.presets import map_settings
from anm_gym.map.settings import (
    FieldSettings,
    GridSettings,
    KeyframeSettings,
    LossSettings,
    MapSettings,
    SamplingSettings,
    ScheduleSettings,
    VariabilitySettings,
)
from anm_gym.map.variable_surface import SurfaceSettings


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
    with pytest.raises(ValueError, match="`window_frames` must be >= 3, got 2"):
        SamplingSettings(window_frames=2)
    with pytest.raises(ValueError, match="must be >= 1"):
        SamplingSettings(rays_per_frame=0)
    with pytest.raises(ValueError, match=r"`gradient_share` must be in \(0, 1\], got 0"):
        LossSettings(gradient_share=0.0)
    with pytest.raises(ValueError, match=r"`network_share` must be in \(0, 1\], got 2"):
        LossSettings(network_share=2.0)


@pytest.mark.parametrize(
    ("settings", "change"),
    [
        (VariabilitySettings, {"family": "lapalce"}),
        (VariabilitySettings, {"draws": 0}),
        (LossSettings, {"distance_target": "clowd"}),
        (KeyframeSettings, {"test": "surfce"}),
        (SamplingSettings, {"replay": "loss"}),
        (SamplingSettings, {"fill_in_rays": -1}),
        (SamplingSettings, {"fill_in_candidates": 0}),
        (SamplingSettings, {"min_depth_m": 9.0}),
        (SurfaceSettings, {"reference_points": 0}),
        (SurfaceSettings, {"reference_quantile": 2.0}),
        (FieldSettings, {"activation": "tanh"}),
        (ScheduleSettings, {"learning_rate": 0.0}),
        (ScheduleSettings, {"iterations": -1}),
        (SamplingSettings, {"near_surface_std_m": -1.0}),
        (SamplingSettings, {"behind_m": -1.0}),
        (LossSettings, {"truncation_m": -1.0}),
        (LossSettings, {"eikonal_weight": -1.0}),
        (KeyframeSettings, {"explained_share": -3.0}),
        (MapSettings, {"reconstruction_std_m": -1.0}),
        (partial(GridSettings, band_m=0.1, noise_m=0.1, prior_std_m=0.1), {"voxel_m": math.nan}),
    ],
)
def test_settings_that_would_run_something_else_are_refused(settings: Any, change: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=f"`{next(iter(change))}` must be"):
        settings(**change)
