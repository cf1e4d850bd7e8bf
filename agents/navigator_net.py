"""The network of learned navigators: what is seen, remembered and wanted, through an LSTM, to an action.

Plain torch, so that a trained policy runs without the library that trained it.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Final, NamedTuple, final

import numpy as np
import torch
from torch import Tensor, nn

from agents.ego_memory import FLAGS, EgoMemorySettings, lattice_offsets
from agents.goal_wave import GoalWaveSettings
from agents.resnet import BLOCKS, DepthResNet
from agents.way_out import WayOutSettings
from anm_gym.actions import Action
from anm_gym.checks import check_at_least

NUM_ACTIONS: Final = len(Action)
NUM_PREVIOUS: Final = NUM_ACTIONS + 1
"""Symbols of the previous action; the last stands for the start of an episode."""
EMBEDDING: Final = 32
"""Size of the embeddings of goal and previous action (DD-PPO)."""
GOAL_NUMBERS: Final = 5
"""Numbers that goal and step length enter the network as."""
NUM_PLANES: Final = len(FLAGS) + 3
"""Planes of each map: its flags and three distances to the goal."""
GOAL_SCALE_M: Final = 10.0
"""Distances are divided by this before they enter the network, metres."""
SMALLEST_CROP: Final = 16
"""Maps with fewer rows do not pass the layers of their encoder, cells."""
FORMER_KEYS: Final = frozenset({"max_rounds"})
"""What files may still say of waves, and nobody asks any more."""
WORK_WINDOW_CELLS: Final = 160
"""Window of the wave when a trained network is used: 32 m instead of 10 m, as wide as homes are."""
WORK_BLOCKED_COST: Final = 200.0
"""Price of a metre through what is blocked: a wall of one cell then costs 40 m, not 4, and is gone round."""
State = tuple[Tensor, Tensor]


@dataclass(frozen=True)
class NavigatorNetSettings:
    """Size of the network."""

    vision: str = "small"
    """Encoder of the depth image: `small`, `resnet18` or `resnet50`."""
    uses_maps: bool = True
    """Whether the maps of `EgoMemory` are an input (ours)."""
    image_px: int = 64
    """Rows and columns of the depth image."""
    lstm_size: int = 192
    """Hidden units of a layer of the LSTM."""
    lstm_layers: int = 1
    """Layers of the LSTM."""
    memory: EgoMemorySettings = field(default_factory=EgoMemorySettings)
    """Maps around the agent."""

    def __post_init__(self) -> None:
        if self.vision not in {"small", *BLOCKS}:
            raise ValueError(f"`vision` must be one of small, {', '.join(BLOCKS)}, got {self.vision!r}")
        if self.uses_maps and self.memory.crop_cells < SMALLEST_CROP:
            raise ValueError(f"`crop_cells` must be >= {SMALLEST_CROP}, got {self.memory.crop_cells}")
        check_at_least(self, 1, "image_px", "lstm_size", "lstm_layers")

    @classmethod
    def read(cls, values: Mapping[str, Any]) -> "NavigatorNetSettings":
        """Read what `asdict` wrote, with lists for tuples."""
        memory: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value for key, value in values["memory"].items()
        }
        memory["wave"] = GoalWaveSettings(**_without_former(memory["wave"]))
        memory["way_out"] = WayOutSettings(**_without_former(memory.get("way_out", {})))
        return cls(**{**values, "memory": EgoMemorySettings(**memory)})

    def at_work(self) -> "NavigatorNetSettings":
        """The same with a wave that reaches farther than in training, and round longer walls.

        The network is shown crops of the wave only, so it may have spread from farther away.
        """
        wave = self.memory.wave
        wider = replace(
            wave,
            window_cells=max(WORK_WINDOW_CELLS, wave.window_cells),
            blocked_cost=max(WORK_BLOCKED_COST, wave.blocked_cost),
        )
        return replace(self, memory=replace(self.memory, wave=wider))

    def as_dict(self) -> dict[str, Any]:
        """Plain values for a file."""
        return asdict(self)


def _without_former(values: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if key not in FORMER_KEYS}


class Outputs(NamedTuple):
    """What the network says of frames."""

    logits: Tensor
    """(B, actions) unnormalised log-probabilities."""
    values: Tensor
    """(B,) expected return."""


@final
class NavigatorEncoder(nn.Module):
    """Turn the observations of frames into feature vectors.

    Args:
        settings: Sizes.
    """

    def __init__(self, settings: NavigatorNetSettings) -> None:
        super().__init__()
        self.settings = settings
        if settings.vision == "small":
            self.vision: nn.Module = _small_vision(settings.image_px)
            vision_size = 64
        else:
            self.vision, vision_size = DepthResNet(settings.vision, settings.image_px), 512
        self.goal = nn.Linear(GOAL_NUMBERS, EMBEDDING)
        self.previous = nn.Embedding(NUM_PREVIOUS, EMBEDDING)
        self.features = vision_size + 2 * EMBEDDING
        if settings.uses_maps:
            scales = range(len(settings.memory.cell_m))
            self.maps = nn.ModuleList(_map_layers(settings.memory.crop_cells) for _ in scales)
            self.features += 128 * len(scales)
            lattices = np.stack([lattice_offsets(settings.memory, scale) for scale in scales])
            extents = np.abs(lattices).max(axis=(1, 2, 3))
            self._lattices: Tensor
            self._extents: Tensor
            self._flags: Tensor
            self.register_buffer("_lattices", torch.from_numpy(lattices), persistent=False)
            self.register_buffer("_extents", torch.from_numpy(extents), persistent=False)
            self.register_buffer("_flags", torch.from_numpy(np.array(FLAGS)), persistent=False)

    def forward(self, observation: Mapping[str, Tensor]) -> Tensor:
        """Encode frames.

        Args:
            observation: Of B frames: `depth` (B, 1, H, W) uint8, 255 is 10 m; `goal` (B, 2) float32,
                metres and radians; `previous_action` (B, 1); `forward_step_m` (B, 1) float32; and with
                maps `maps` (B, scales, rows, columns) uint8 of flags, and `waves` of the same shape.

        Returns:
            (B, features) float32.
        """
        distance_m, bearing_rad = observation["goal"].float().unbind(dim=1)
        goal = torch.stack(
            [
                distance_m / GOAL_SCALE_M,
                torch.exp(-distance_m),
                torch.cos(bearing_rad),
                torch.sin(bearing_rad),
                4.0 * observation["forward_step_m"].float().flatten(),
            ],
            dim=1,
        )
        parts = [
            self.vision(observation["depth"].float() / 255.0),
            self.goal(goal),
            self.previous(observation["previous_action"].long().flatten()),
        ]
        if self.settings.uses_maps:
            waves = observation["waves"].float() / 127.5 - 1.0
            parts += self._encode_maps(observation["maps"].to(torch.uint8), waves, distance_m, bearing_rad)
        return torch.cat(parts, dim=1)

    def _encode_maps(
        self, maps: Tensor, waves: Tensor, distance_m: Tensor, bearing_rad: Tensor
    ) -> list[Tensor]:
        """(B, 128) of each map; to its flags come the distances of cells to the goal, straight and not."""
        flags = (maps[:, :, None] & self._flags[:, None, None]) > 0
        goal = torch.stack([-torch.sin(bearing_rad), torch.cos(bearing_rad)], dim=1) * distance_m[:, None]
        apart_m = torch.linalg.vector_norm(self._lattices - goal[:, None, None, None], dim=-1)
        nearer = (distance_m[:, None, None, None] - apart_m) / self._extents[:, None, None]
        distances = torch.stack([torch.exp(-apart_m), nearer, waves], dim=2)
        planes = torch.cat([flags.float(), distances], dim=2)
        return [layers(planes[:, scale]) for scale, layers in enumerate(self.maps)]


@final
class NavigatorNet(nn.Module):
    """Encoder, LSTM, actor and critic.

    Args:
        settings: Sizes.

    Source:
        Wijmans et al., DD-PPO, ICLR 2020: depth, goal and previous action into one LSTM whose output
        both heads read. The maps are ours.
    """

    def __init__(self, settings: NavigatorNetSettings | None = None) -> None:
        super().__init__()
        self.settings = settings or NavigatorNetSettings()
        self.encoder = NavigatorEncoder(self.settings)
        self.lstm = nn.LSTM(self.encoder.features, self.settings.lstm_size, self.settings.lstm_layers)
        self.actor = nn.Linear(self.settings.lstm_size, NUM_ACTIONS)
        self.critic = nn.Linear(self.settings.lstm_size, 1)
        initialise_heads(self.lstm, self.actor, self.critic)

    def step(self, observation: Mapping[str, Tensor], state: State, starts: Tensor) -> tuple[Outputs, State]:
        """Run over one frame of each of N agents.

        Args:
            observation: See `NavigatorEncoder`; B = N.
            state: State after the frame before, two (layers, N, size).
            starts: (N,) 1 where an episode begins: the state is forgotten there.

        Returns:
            The outputs, and the state after the frame.
        """
        latent, state = step_lstm(self.lstm, self.encoder(observation), state, starts)
        return Outputs(self.actor(latent), self.critic(latent).flatten()), state

    def forward(self, observation: Mapping[str, Tensor], state: State, starts: Tensor) -> Outputs:
        """Run over N sequences of T frames, to learn from them.

        Args:
            observation: See `NavigatorEncoder`; B = N * T, the frames of a sequence side by side.
            state: State before the first frame of each sequence, two (layers, N, size).
            starts: (N * T,) 1 where an episode begins.
        """
        latent = run_lstm(self.lstm, self.encoder(observation), state, starts)
        return Outputs(self.actor(latent), self.critic(latent).flatten())

    def first_state(self, num_sequences: int) -> State:
        """The state at the start of episodes, two (layers, N, size) zeros."""
        shape = (self.settings.lstm_layers, num_sequences, self.settings.lstm_size)
        device = self.actor.weight.device
        return torch.zeros(shape, device=device), torch.zeros(shape, device=device)


def initialise_heads(lstm: nn.LSTM, actor: nn.Linear, critic: nn.Linear) -> None:
    """Orthogonal weights and zero biases; a small actor, so that all actions begin alike (DD-PPO)."""
    for name, values in lstm.named_parameters():
        if name.startswith("weight"):
            nn.init.orthogonal_(values)
        else:
            nn.init.zeros_(values)
    for head, gain in ((actor, 0.01), (critic, 1.0)):
        nn.init.orthogonal_(head.weight, gain)
        nn.init.zeros_(head.bias)


def step_lstm(lstm: nn.LSTM, features: Tensor, state: State, starts: Tensor) -> tuple[Tensor, State]:
    """Run an LSTM over one frame of each of N agents.

    Args:
        lstm: The LSTM.
        features: (N, F).
        state: After the frame before, two (layers, N, size).
        starts: (N,) 1 where an episode begins: the state is forgotten there.

    Returns:
        (N, size) outputs, and the state after the frame.
    """
    kept = (starts < 0.5).to(features.dtype)[None, :, None]
    outputs, state = lstm(features[None], (state[0] * kept, state[1] * kept))
    return outputs[0], state


def run_lstm(lstm: nn.LSTM, features: Tensor, state: State, starts: Tensor) -> Tensor:
    """Run an LSTM over sequences in which episodes begin.

    Every episode becomes a sequence of its own, so that one fused call does for all; a loop over
    frames, which is how libraries reset states, takes several times as long.

    Args:
        lstm: The LSTM.
        features: (N * T, F), the frames of a sequence side by side.
        state: Before the first frames, two (layers, N, size).
        starts: (N * T,) 1 where an episode begins.

    Returns:
        (N * T, size) outputs.
    """
    num = state[0].shape[1]
    begins = starts.reshape(num, -1) > 0.5
    length = begins.shape[1]
    is_first = begins.clone()
    is_first[:, 0] = True
    first = torch.nonzero(is_first.flatten()).flatten()
    piece = torch.cumsum(is_first.flatten().long(), dim=0) - 1
    place = torch.arange(num * length, device=features.device) - first[piece]
    padded = features.new_zeros(int(place.max()) + 1, len(first), features.shape[1])
    padded[place, piece] = features
    goes_on = (~begins.flatten()[first]).to(features.dtype)[None, :, None]
    sequence = torch.div(first, length, rounding_mode="floor")
    outputs, _ = lstm(padded, (state[0][:, sequence] * goes_on, state[1][:, sequence] * goes_on))
    return torch.as_tensor(outputs[place, piece])


def _small_vision(image_px: int) -> nn.Module:
    layers = nn.Sequential(
        nn.Conv2d(1, 16, 8, 4),
        nn.ReLU(),
        nn.Conv2d(16, 32, 4, 2),
        nn.ReLU(),
        nn.Conv2d(32, 32, 3, 2 if image_px > 64 else 1),
        nn.ReLU(),
        nn.Flatten(),
    )
    return _with_linear(layers, (1, image_px, image_px), 64)


def _map_layers(crop_cells: int) -> nn.Module:
    layers = nn.Sequential(
        nn.Conv2d(NUM_PLANES, 16, 4, 2),
        nn.ReLU(),
        nn.Conv2d(16, 32, 3, 2),
        nn.ReLU(),
        nn.Conv2d(32, 32, 3, 1),
        nn.ReLU(),
        nn.Flatten(),
    )
    return _with_linear(layers, (NUM_PLANES, crop_cells, crop_cells), 128)


def _with_linear(layers: nn.Sequential, shape: tuple[int, int, int], features: int) -> nn.Module:
    with torch.no_grad():
        flat = layers(torch.zeros(1, *shape)).shape[1]
    return nn.Sequential(*layers, nn.Linear(flat, features), nn.ReLU())
