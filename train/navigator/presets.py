"""Settings of the navigator's training: presets of the network, variants of the homes."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, is_dataclass, replace
from typing import Any, Final

from agents.navigator_net import NavigatorNetSettings
from anm_gym.checks import check_at_least, check_known
from train.navigator.dagger import DaggerSettings
from train.navigator.env import DomainSettings
from train.navigator.ppo import PpoSettings

SMALLEST_IMAGE_PX: Final = 36
"""Images that are smaller do not pass the layers of the small encoder, pixels."""


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

    def __post_init__(self) -> None:
        check_at_least(self, 1, "num_agents", "evaluation_every", "evaluation_episodes")
        check_at_least(self, 0, "seed")
        if self.net.image_px < SMALLEST_IMAGE_PX:
            raise ValueError(f"`net.image_px` must be >= {SMALLEST_IMAGE_PX}, got {self.net.image_px}")
        self.net.at_work()  # the wave is wider there
        stage = self.reinforcement
        if not self.imitation.frames and not stage.frames:
            raise ValueError("`imitation.frames` or `reinforcement.frames` must be > 0, got 0 and 0")
        if stage.frames and self.num_agents % stage.minibatches:
            raise ValueError(
                "`num_agents` must be a multiple of `reinforcement.minibatches`, got "
                f"{self.num_agents} and {stage.minibatches}"
            )
        self.require_taught_actor()

    def require_taught_actor(self, processes: int = 1) -> None:
        """Refuse a second stage that ends while the critic still learns alone.

        Args:
            processes: How many learn together: each collects a rollout before all learn from them.

        Raises:
            ValueError: If the last rollout begins before `reinforcement.value_frames`.
        """
        stage, rollout = self.reinforcement, processes * self.num_agents * self.reinforcement.rollout_steps
        last_start = max(stage.frames - 1, 0) // rollout * rollout
        if stage.frames and last_start < stage.value_frames:
            raise ValueError(
                "`reinforcement.frames` must leave a rollout for the actor after the "
                f"{stage.value_frames} frames in which the critic learns alone, got {stage.frames} frames in "
                f"rollouts of {rollout}; raise it, or lower `reinforcement.value_frames`"
            )

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
            frames=2_500_000_000,
            minibatches=2,
            decays_learning_rate=False,
            normalises_advantages=False,
            value_frames=0,
        ),
        num_agents=4,
        evaluation_every=1_000_000,
    ),
    "quick": NavigatorTraining(
        imitation=DaggerSettings(frames=1_024, teacher_frames=512, segments=4, updates_per_rollout=1),
        reinforcement=PpoSettings(frames=1_024, rollout_steps=32, value_frames=512),
        num_agents=8,
        evaluation_every=1_024,
        evaluation_episodes=1,
    ),
}
"""`mini` trains on two cores in an afternoon; `full` is DD-PPO's network and budget; `quick` only shows
that all works."""


def training_of(
    preset: str,
    variant: str,
    changes: Mapping[str, Any] | None = None,
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
        changes: Fields of `NavigatorTraining` that differ from them, those of its stages in mappings of their
            own, such as ``{"reinforcement": {"learning_rate": 1e-4}}``.
        imitation_frames: Budget of the first stage; None for the preset's.
        reinforcement_frames: Budget of the second stage; None for the preset's.
        num_agents: Agents of each process; None for the preset's.
        seed: Seeds everything.

    Raises:
        ValueError: If preset or variant is unknown, frames are given twice, or the settings do not fit
            together.
    """
    check_known("preset", preset, PRESETS)
    check_known("variant", variant, VARIANTS)
    wanted = dict(changes or {})
    for stage, frames in (("imitation", imitation_frames), ("reinforcement", reinforcement_frames)):
        if frames is None:
            continue
        if "frames" in wanted.get(stage, {}):
            raise ValueError(f"`{stage}_frames` and `{stage}.frames` must not both be given")
        wanted[stage] = {**wanted.get(stage, {}), "frames": frames}
    if num_agents is not None:
        wanted["num_agents"] = num_agents
    training: NavigatorTraining = _changed(
        replace(PRESETS[preset], domain=VARIANTS[variant], seed=seed), wanted
    )
    return training


def _changed(settings: Any, changes: Mapping[str, Any]) -> Any:
    """Replace fields, those of dataclasses within by their own; checked once, when all are replaced."""
    values = {}
    for name, value in changes.items():
        before = getattr(settings, name)
        values[name] = _changed(before, value) if is_dataclass(before) else value
    return replace(settings, **values)
