"""Settings of the navigator's training: presets of the network, variants of the homes."""

from dataclasses import asdict, dataclass, field, replace
from typing import Any, Final

from agents.navigator_net import NavigatorNetSettings
from train.navigator.dagger import DaggerSettings
from train.navigator.env import DomainSettings
from train.navigator.ppo import PpoSettings


@dataclass(frozen=True)
class NavigatorTraining:
    """Everything that decides what a training run does."""

    net: NavigatorNetSettings = field(default_factory=NavigatorNetSettings)
    """The network."""
    domain: DomainSettings = field(default_factory=DomainSettings)
    """Homes and bodies."""
    imitation: DaggerSettings = field(default_factory=DaggerSettings)
    """First stage."""
    reinforcement: PpoSettings = field(default_factory=PpoSettings)
    """Second stage."""
    num_agents: int = 16
    """Agents of each process."""
    evaluation_every: int = 150_000
    """Frames between two evaluations on unseen homes."""
    evaluation_episodes: int = 18
    """Episodes of such an evaluation, per step length."""
    seed: int = 0
    """Seeds everything."""

    def as_dict(self) -> dict[str, Any]:
        """Plain values for a file."""
        return asdict(self)


SMALL_HOMES: Final = {"studio": 0.4, "flat": 0.6}
"""Tiers of the variant that has seen small homes only."""
VARIANTS: Final = {
    "plus": DomainSettings(),
    "star": DomainSettings(tiers=SMALL_HOMES),
}
"""`plus` trains on all tiers, `star` on small homes only: the two navigators of Active Neural Mapping's
Module 3 differ in the same way."""

PRESETS: Final = {
    "mini": NavigatorTraining(),
    "full": NavigatorTraining(
        net=NavigatorNetSettings(
            vision="resnet50", uses_maps=False, image_px=256, lstm_size=512, lstm_layers=2
        ),
        imitation=DaggerSettings(frames=0),
        reinforcement=PpoSettings(
            frames=2_500_000_000, minibatches=2, normalises_advantages=False, value_frames=0
        ),
        num_agents=4,
        evaluation_every=1_000_000,
    ),
    "quick": NavigatorTraining(
        imitation=DaggerSettings(frames=1_024, teacher_frames=512, segments=4, updates_per_rollout=1),
        reinforcement=PpoSettings(frames=1_024, rollout_steps=64, value_frames=512),
        num_agents=8,
        evaluation_every=2_048,
        evaluation_episodes=4,
    ),
}
"""`mini` trains on two cores in an afternoon; `full` is DD-PPO's network and budget; `quick` only shows
that all works."""


def training_of(
    preset: str,
    variant: str,
    *,
    imitation_frames: int | None = None,
    reinforcement_frames: int | None = None,
    num_agents: int | None = None,
    seed: int = 0,
) -> NavigatorTraining:
    """Settings of a run.

    Args:
        preset: One of `PRESETS`.
        variant: One of `VARIANTS`.
        imitation_frames: Budget of the first stage; None for the preset's.
        reinforcement_frames: Budget of the second stage; None for the preset's.
        num_agents: Agents of each process; None for the preset's.
        seed: Seeds everything.

    Raises:
        ValueError: If preset or variant is unknown.
    """
    for name, value, known in (("preset", preset, PRESETS), ("variant", variant, VARIANTS)):
        if value not in known:
            raise ValueError(f"unknown {name} {value!r}; choose one of: {', '.join(known)}")
    training = replace(PRESETS[preset], domain=VARIANTS[variant], seed=seed)
    if imitation_frames is not None:
        training = replace(training, imitation=replace(training.imitation, frames=imitation_frames))
    if reinforcement_frames is not None:
        stage = replace(training.reinforcement, frames=reinforcement_frames)
        training = replace(training, reinforcement=stage)
    return training if num_agents is None else replace(training, num_agents=num_agents)
