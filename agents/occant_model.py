"""The networks of OccAnt and ANS, and their files: what completes a look, and what chooses a goal."""

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final, final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.goal_net import GoalNet, GoalNetSettings
from agents.layout_memory import LayoutSettings
from agents.occupancy_net import PlainUnet, channels_last
from agents.weights_file import WEIGHTS_FOLDER, WeightsFormat, prefixed, without_prefix
from agents.weights_identity import WeightsIdentity, weights_digest
from anm_gym.checks import check_at_least
from anm_gym.map.projection import PRESETS, ProjectionSettings

FORMAT: Final = WeightsFormat("anm_gym.occant.1", "model", hint="; train one with `python -m train.occant`")
LOOK_CHANNELS: Final = 2
"""Occupied and explored."""
PROJECTION: Final = replace(PRESETS["occant"], max_depth_m=6.4, obstacle_growths=1, free_growths=1)
"""How depth becomes a look."""


@dataclass(frozen=True)
class OccAntSettings:
    """What the networks are, and the maps that they were trained on."""

    anticipates: bool = True
    """Complete every look by the U-Net; without it this is ANS."""
    width: int = 8
    """Channels of the U-Net's first level (16 in the paper's code)."""
    goal_net: GoalNetSettings = field(default_factory=GoalNetSettings)
    """Layers of the global policy."""
    layout: LayoutSettings = field(default_factory=LayoutSettings)
    """Sizes of the maps."""
    projection: ProjectionSettings = PROJECTION
    """How depth becomes a look: as far as the patch reaches; masks grow as many metres as in the paper's
    code, whose cells are half as large."""
    look_every_steps: int = 5
    """A look is added after so many of the usual steps, 33 cm or 50 degrees: about a step of the paper."""

    def __post_init__(self) -> None:
        check_at_least(self, 1, "width", "look_every_steps")

    @classmethod
    def read(cls, plain: dict[str, Any]) -> "OccAntSettings":
        """Build settings from the values of a file."""
        net = {name: tuple(values) for name, values in plain["goal_net"].items()}
        parts = {
            "goal_net": GoalNetSettings(**net),
            "layout": LayoutSettings(**plain["layout"]),
            "projection": ProjectionSettings(**plain["projection"]),
        }
        return cls(**{**plain, **parts})


@final
class Anticipator:
    """Complete looks beyond what they show.

    Args:
        net: From occupied and explored masks to logits of the same.

    Source:
        Occupancy Anticipation, Ramakrishnan et al., 2020, the variant that sees depth only.
    """

    def __init__(self, net: nn.Module) -> None:
        self.net = channels_last(net.eval())

    @torch.inference_mode()
    def __call__(self, looks: NDArray[np.float32]) -> NDArray[np.float32]:
        """Complete (N, 2, V, V) looks; returns probabilities, occupied and explored, float32."""
        raster = torch.from_numpy(looks).contiguous(memory_format=torch.channels_last)
        logits: Tensor = self.net(raster)
        return np.asarray(logits.sigmoid().contiguous().numpy())


@final
class OccAntModel:
    """Anticipator and global policy.

    Args:
        settings: What they are.
        goal_net: The global policy.
        anticipator: None if the settings have none.

    Raises:
        ValueError: If settings and anticipator disagree.
    """

    def __init__(self, settings: OccAntSettings, goal_net: GoalNet, anticipator: Anticipator | None) -> None:
        if settings.anticipates != (anticipator is not None):
            raise ValueError("`anticipator` must be given if and only if `settings.anticipates`")
        self.settings, self.anticipator = settings, anticipator
        self.goal_net = goal_net.eval()

    @property
    def identity(self) -> WeightsIdentity:
        """What tells it from others."""
        completing = [] if self.anticipator is None else [self.anticipator.net]
        return WeightsIdentity(self.settings, weights_digest([self.goal_net, *completing]))

    @torch.inference_mode()
    def score_goals(self, view: NDArray[np.float32]) -> NDArray[np.float32]:
        """Log-probabilities of the goals, (G * G,) float32, for a view (9, G, G)."""
        logits = self.goal_net(torch.from_numpy(view)[None])[0]
        return np.asarray(logits.log_softmax(dim=0).numpy())


def new_anticipator_net(settings: OccAntSettings, seed: int) -> PlainUnet:
    """Build an untrained anticipator; the same seed gives the same weights."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return PlainUnet(LOOK_CHANNELS, LOOK_CHANNELS, settings.width)


def new_goal_net(settings: OccAntSettings, seed: int) -> GoalNet:
    """Build an untrained global policy; the same seed gives the same weights."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return GoalNet(settings.goal_net)


def save_model(model: OccAntModel, path: str | Path) -> None:
    """Write a model so that `load_model` restores it, 16 bits a weight; the file appears whole or not at all.

    Args:
        model: The model.
        path: A ``.safetensors`` file; an older one is replaced.
    """
    tensors = prefixed("goal", model.goal_net, is_half=True)
    if model.anticipator is not None:
        tensors |= prefixed("anticipator", model.anticipator.net, is_half=True)
    FORMAT.write(path, tensors, asdict(model.settings))


def load_model(name_or_path: str | Path) -> OccAntModel:
    """Read a model that `save_model` wrote.

    Args:
        name_or_path: A file, or the name of one in `WEIGHTS_FOLDER`: ``"occant"`` or ``"ans"``.

    Raises:
        PolicyError: If the file is missing, truncated, of another format or does not fit its settings.
    """
    path = Path(name_or_path)
    path = path if path.suffix else WEIGHTS_FOLDER / f"{name_or_path}.safetensors"
    with FORMAT.reading(path) as (plain, tensors):
        settings = OccAntSettings.read(plain)
        goal_net = new_goal_net(settings, seed=0)
        goal_net.load_state_dict(without_prefix("goal", tensors))
        anticipator = None
        if settings.anticipates:
            net = new_anticipator_net(settings, seed=0)
            net.load_state_dict(without_prefix("anticipator", tensors))
            anticipator = Anticipator(net)
    return OccAntModel(settings, goal_net, anticipator)
