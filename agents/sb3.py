"""Policies for Stable-Baselines3 that look at what `PolicyViewWrapper` shows.

The only module of the agents that knows Stable-Baselines3; commands and its zoo name the policies by
their import path.
"""

from typing import Any

import torch
from gymnasium import spaces
from sb3_contrib.common.recurrent.policies import RecurrentMultiInputActorCriticPolicy
from stable_baselines3.common.policies import MultiInputActorCriticPolicy
from stable_baselines3.common.preprocessing import is_image_space
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

GOAL_KEY = "pointgoal_with_gps_compass"
FAR_M = 10.0
"""Distances to a goal are squashed on this scale, metres."""
MIN_IMAGE_PX = 28
"""Smallest edge of an image that the convolutions leave something of, pixels."""


class ViewFeatures(BaseFeaturesExtractor):
    """Convolve the images, turn the goal's bearing into cosine and sine, and join them.

    Args:
        observation_space: `Dict` of images in bytes, channels first, and vectors.
        features_dim: Number of features.
        width: Channels of the first convolution; the others have twice as many.

    Raises:
        ValueError: If an image is smaller than `MIN_IMAGE_PX`.
    """

    def __init__(self, observation_space: spaces.Dict, features_dim: int = 128, width: int = 16) -> None:
        super().__init__(observation_space, features_dim)
        self.images = nn.ModuleDict()
        size = 0
        self._keys = tuple(observation_space.spaces)  # an observation may have them in another order
        for key, space in observation_space.spaces.items():
            assert space.shape is not None
            if is_image_space(space):
                if min(space.shape[1:]) < MIN_IMAGE_PX:
                    raise ValueError(
                        f"`{key}` must have edges of at least {MIN_IMAGE_PX} pixels, got {space.shape[1:]}"
                    )
                self.images[key] = _convolutions(space.shape[0], width)
                with torch.no_grad():
                    size += self.images[key](torch.zeros(1, *space.shape)).shape[1]
            else:
                size += 3 if key == GOAL_KEY else spaces.flatdim(space)
        self.joined = nn.Sequential(nn.Linear(size, features_dim), nn.ReLU())

    def forward(self, observations: dict[str, Tensor]) -> Tensor:
        """Make (N, features_dim) features; images come as floats from 0 to 1."""
        parts = []
        for key in self._keys:
            value = observations[key]
            if key in self.images:
                parts.append(self.images[key](value))
            else:
                parts.append(goal_features(value) if key == GOAL_KEY else value.flatten(1))
        features: Tensor = self.joined(torch.cat(parts, dim=1))
        return features


def goal_features(goal: Tensor) -> Tensor:
    """Turn (N, 2) distances, metres, and bearings, radians, into (N, 3) numbers within [-1, 1]."""
    distance_m, bearing_rad = goal.unbind(dim=1)
    return torch.stack([torch.tanh(distance_m / FAR_M), bearing_rad.cos(), bearing_rad.sin()], dim=1)


class ViewPolicy(MultiInputActorCriticPolicy):
    """Actor and critic over `ViewFeatures`, for PPO."""

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **{"features_extractor_class": ViewFeatures, **settings})


class RecurrentViewPolicy(RecurrentMultiInputActorCriticPolicy):
    """Actor and critic with a memory over `ViewFeatures`, for RecurrentPPO."""

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **{"features_extractor_class": ViewFeatures, **settings})


def _convolutions(channels: int, width: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(channels, width, 4, stride=4),
        nn.ReLU(),
        nn.Conv2d(width, 2 * width, 3, stride=2),
        nn.ReLU(),
        nn.Conv2d(2 * width, 2 * width, 3, stride=2),
        nn.ReLU(),
        nn.Flatten(),
    )
