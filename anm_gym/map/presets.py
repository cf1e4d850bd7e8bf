"""Presets of the neural map, and the substitutions that the paper's ablation makes in them.

`paper` follows the text of Active Neural Mapping, `released` the behaviour of its released code, `best`
and its cheaper sibling `fast` are ours. The differences are argued in ``docs/paper.md``.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Final, get_args

from anm_gym.checks import check_known
from anm_gym.map.settings import (
    FieldSettings,
    GridSettings,
    KeyframeSettings,
    LossSettings,
    MapSettings,
    PerturbationFamily,
    Replay,
    SamplingSettings,
    ScheduleSettings,
    VariabilitySettings,
)

DRAWS: Final = {"laplace": 128, "dropout": 5}
"""Draws of a family that replaces a preset's own, where they differ from `USUAL_DRAWS`."""
USUAL_DRAWS: Final = 20
"""Draws of the families that move all weights (released code)."""
DROPOUT: Final = 0.05
"""Share of dropped units in the paper's ablation (Sec. 5.4, Module 1)."""

PAPER: Final = MapSettings()
RELEASED: Final = MapSettings(
    preset="released",
    field=FieldSettings(hidden_layers=6),
    schedule=ScheduleSettings(iterations=5, weight_decay=0.012),
    variability=VariabilitySettings(family="unit_norm", statistic="mean_absolute"),
)
BEST: Final = MapSettings(
    preset="best",
    field=FieldSettings(
        width=128,
        grids=(
            GridSettings(voxel_m=0.2, band_m=100.0, noise_m=0.1, prior_std_m=0.3),
            GridSettings(voxel_m=0.05, band_m=0.15, noise_m=0.03, prior_std_m=0.06),
        ),
    ),
    sampling=SamplingSettings(
        window_frames=8,
        rays_per_frame=60,
        stratified=4,
        near_surface=6,
        near_surface_std_m=0.06,
        behind_m=0.08,
        fill_window=True,
    ),
    loss=LossSettings(
        distance_target="cloud", regress_free_space=True, gradient_share=0.25, network_share=0.3
    ),
    schedule=ScheduleSettings(
        first_iterations=60,
        iterations=1,
        keyframe_iterations=2,
        learning_rate=0.0015,
        output_noise=0.0,
        keyframe_output_noise=0.0,
        bfloat16=True,
    ),
    keyframes=KeyframeSettings(test="surface", rays=200, relative_error=0.05, max_interval=50),
    variability=VariabilitySettings(family="laplace", draws=128),
    reconstruction_std_m=0.04,
)
FAST: Final = replace(
    BEST,
    preset="fast",
    field=replace(BEST.field, width=64),
    sampling=replace(BEST.sampling, rays_per_frame=30, fill_in_rays=300),
    loss=replace(BEST.loss, network_share=0.5),
)
PRESETS: Final = {settings.preset: settings for settings in (PAPER, RELEASED, FAST, BEST)}

Variant = Callable[[MapSettings], MapSettings]


def _with_family(settings: MapSettings, family: PerturbationFamily) -> MapSettings:
    variability = replace(settings.variability, family=family, draws=DRAWS.get(family, USUAL_DRAWS))
    field = replace(settings.field, dropout=DROPOUT) if family == "dropout" else settings.field
    return replace(settings, field=field, variability=variability)


def _with_relu(settings: MapSettings) -> MapSettings:
    field = replace(settings.field, activation="relu", encoding="axes", joins_encoding=False)
    return replace(settings, field=field)


def _with_replay(settings: MapSettings, replay: Replay) -> MapSettings:
    return replace(settings, sampling=replace(settings.sampling, replay=replay))


VARIANTS: Final[dict[str, Variant]] = {
    **{family: partial(_with_family, family=family) for family in get_args(PerturbationFamily)},
    "relu": _with_relu,
    "no_replay": partial(_with_replay, replay="none"),
    "uniform_replay": partial(_with_replay, replay="uniform"),
}
"""Substitutions by name: a perturbation family (`dropout` is the paper's Module 1), the network of Module
4 (`relu`), and other ways to replay."""


def map_settings(preset: str) -> MapSettings:
    """Look up a preset by name.

    Args:
        preset: One of `PRESETS`, with any of `VARIANTS` behind it: ``"best"``, ``"paper+relu+dropout"``.

    Returns:
        The settings, filed under the whole name.

    Raises:
        ValueError: If there is no such preset or variant.
    """
    base, *variants = preset.split("+")
    check_known("map preset", base, PRESETS)
    settings = PRESETS[base]
    for variant in variants:
        check_known("variant", variant, VARIANTS)
        settings = VARIANTS[variant](settings)
    return replace(settings, preset=preset)
