"""Settings of the training: chosen by name, changed one by one, refused before a run begins."""

from dataclasses import replace

import pytest

from train.navigator.dagger import DaggerSettings
from train.navigator.env import DomainSettings
from train.navigator.ppo import PpoSettings
from train.navigator.presets import PRESETS, VARIANTS, training_of


def test_presets_and_variants_are_chosen_by_name() -> None:
    training = training_of("mini", "star", imitation_frames=7, num_agents=4, seed=3)
    assert training.domain == VARIANTS["star"]
    assert (training.imitation.frames, training.num_agents, training.seed) == (7, 4, 3)
    assert training.reinforcement == PRESETS["mini"].reinforcement
    assert PRESETS["full"].net.vision == "resnet50"
    assert not PRESETS["full"].reinforcement.decays_learning_rate
    with pytest.raises(ValueError, match="unknown preset 'huge'; choose one of: mini, full, quick"):
        training_of("huge", "plus")
    with pytest.raises(ValueError, match="unknown variant 'moon'; choose one of: plus, star"):
        training_of("mini", "moon")


def test_single_fields_change_and_the_rest_stays() -> None:
    changes = {"reinforcement": {"learning_rate": 1e-4}, "net": {"memory": {"crop_cells": 20}}}
    training = training_of("quick", "star", changes, reinforcement_frames=2_048)
    quick = PRESETS["quick"]
    assert training.reinforcement == replace(quick.reinforcement, learning_rate=1e-4, frames=2_048)
    assert training.net.memory == replace(quick.net.memory, crop_cells=20)
    assert (training.imitation, training.domain) == (quick.imitation, VARIANTS["star"])


def test_fields_that_need_each_other_change_together() -> None:
    training = training_of("mini", "plus", {"reinforcement": {"minibatches": 5}}, num_agents=15)
    assert (training.num_agents, training.reinforcement.minibatches) == (15, 5)


def test_frames_are_given_once() -> None:
    with pytest.raises(
        ValueError, match=r"`imitation_frames` and `imitation\.frames` must not both be given"
    ):
        training_of("mini", "plus", {"imitation": {"frames": 1}}, imitation_frames=2)


@pytest.mark.parametrize("processes", [1, 2])
def test_quick_run_teaches_the_actor_and_is_judged(processes: int) -> None:
    quick = PRESETS["quick"]
    quick.require_taught_actor(processes)
    assert quick.evaluation_every <= quick.imitation.frames


@pytest.mark.parametrize("frames", [1, 40_000, 40_960])
def test_second_stage_that_teaches_the_critic_alone_is_refused(frames: int) -> None:
    """The last rollout of 2048 frames begins within the first 40 000."""
    with pytest.raises(ValueError, match=r"`reinforcement\.frames` must leave a rollout for the actor after"):
        training_of("mini", "plus", reinforcement_frames=frames)


def test_second_stage_may_be_left_out_or_teach_the_actor_at_once() -> None:
    training_of("mini", "plus", reinforcement_frames=0, num_agents=3)
    training_of("mini", "plus", {"reinforcement": {"value_frames": 0}}, reinforcement_frames=1)
    training_of("mini", "plus", reinforcement_frames=40_961)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"num_agents": 0}, "`num_agents` must be >= 1, got 0"),
        ({"num_agents": 6}, "`num_agents` must be a multiple of `reinforcement.minibatches`, got 6 and 4"),
        ({"evaluation_every": 0}, "`evaluation_every` must be >= 1, got 0"),
        ({"seed": -1}, "`seed` must be >= 0, got -1"),
        ({"net": {"image_px": 35}}, "`net.image_px` must be >= 36, got 35"),
        ({"net": {"lstm_layers": 0}}, "`lstm_layers` must be >= 1, got 0"),
        ({"net": {"memory": {"crop_cells": 15}}}, "`crop_cells` must be >= 16, got 15"),
        ({"net": {"memory": {"grid_cells": 128}}}, "`grid_cells` must be a power of two and at least 192"),
        ({"domain": {"forward_step_m": (0.1, float("nan"))}}, "`forward_step_m` must have numbers > 0"),
        (
            {"imitation": {"frames": 0}, "reinforcement": {"frames": 0}},
            "`imitation.frames` or `reinforcement.frames` must be > 0, got 0 and 0",
        ),
    ],
)
def test_settings_that_do_not_fit_are_refused(changes: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        training_of("mini", "plus", changes)


@pytest.mark.parametrize(
    ("settings", "changes", "message"),
    [
        (DaggerSettings, {"frames": -5}, "`frames` must be >= 0, got -5"),
        (DaggerSettings, {"segments": 0}, "`segments` must be >= 1, got 0"),
        (
            DaggerSettings,
            {"capacity_steps": 31},
            "`capacity_steps` must be >= `segment_steps`, got 31",
        ),
        (DaggerSettings, {"learning_rate": 0.0}, "`learning_rate` must be > 0, got 0.0"),
        (PpoSettings, {"frames": -1}, "`frames` must be >= 0, got -1"),
        (PpoSettings, {"minibatches": 0}, "`minibatches` must be >= 1, got 0"),
        (PpoSettings, {"clip_range": 0.0}, "`clip_range` must be > 0, got 0.0"),
        (DomainSettings, {"tiers": {"moon": 1.0}}, "unknown tier 'moon' in `tiers`; choose among: studio"),
        (DomainSettings, {"forward_step_m": ()}, r"`forward_step_m` must have numbers > 0, got \(\)"),
        (DomainSettings, {"sensor_height_m": (0.0,)}, "`sensor_height_m` must have numbers > 0, got"),
        (DomainSettings, {"max_steps": 0}, "`max_steps` must be >= 1, got 0"),
    ],
)
def test_stages_that_cannot_be_are_refused(settings: type, changes: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        settings(**changes)


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("variant", VARIANTS)
def test_every_preset_can_be_trained_in_every_variant(preset: str, variant: str) -> None:
    training = training_of(preset, variant)
    assert (training.net, training.domain) == (PRESETS[preset].net, VARIANTS[variant])
