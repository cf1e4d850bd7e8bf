"""OccAnt's global policy as Stable-Baselines3 trains it: actor and critic over the same maps.

Only the actor, a plain `agents.goal_net.GoalNet`, is kept in the end.
"""

from typing import Any, final

import torch
from stable_baselines3.common.distributions import CategoricalDistribution, Distribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.type_aliases import PyTorchObs, Schedule
from torch import Tensor, nn

from agents.goal_net import GoalNet, GoalNetSettings


@final
class GoalValueNet(nn.Module):
    """Value of a view: strided convolutions and two linear layers (ours).

    Args:
        channels: Channels of the view.
        size: Rows and columns of the view.
        width: Channels of the convolutions.
    """

    def __init__(self, channels: int, size: int, width: int = 16) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for before in (channels, width, width):
            layers += [nn.Conv2d(before, width, 3, stride=2, padding=1), nn.ReLU()]
            size = -(-size // 2)
        head = [nn.Flatten(), nn.Linear(width * size**2, 64), nn.ReLU(), nn.Linear(64, 1)]
        self.layers = nn.Sequential(*layers, *head)

    def forward(self, maps: Tensor) -> Tensor:
        """(N, 1) values of (N, channels, size, size) views."""
        values: Tensor = self.layers(maps.contiguous(memory_format=torch.channels_last))
        return values


@final
class GoalPolicy(ActorCriticPolicy):
    """Actor and critic without shared layers; the actor is fully convolutional, so its logits are the map.

    Args:
        arguments: Positional arguments of Stable-Baselines3's policy.
        goal_net: Layers of the actor.
        options: Keywords of Stable-Baselines3's policy.
    """

    def __init__(self, *arguments: Any, goal_net: GoalNetSettings | None = None, **options: Any) -> None:
        self._goal_net = goal_net or GoalNetSettings()
        super().__init__(*arguments, **options)

    def _build(self, lr_schedule: Schedule) -> None:
        shape = self.observation_space.shape
        assert shape is not None
        self.mlp_extractor = nn.Identity()  # type: ignore[assignment]
        self.action_net = GoalNet(self._goal_net)
        self.value_net = GoalValueNet(shape[0], shape[1])  # type: ignore[assignment]
        self.optimizer = self.optimizer_class(self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs)  # type: ignore[call-arg]

    def forward(self, obs: Tensor, deterministic: bool = False) -> tuple[Tensor, Tensor, Tensor]:
        """Actions, values and log-probabilities."""
        distribution = self.get_distribution(obs)
        actions = distribution.get_actions(deterministic=deterministic)
        return actions, self.value_net(obs), distribution.log_prob(actions)

    def evaluate_actions(self, obs: PyTorchObs, actions: Tensor) -> tuple[Tensor, Tensor, Tensor | None]:
        """Values, log-probabilities and entropies of actions that were taken."""
        distribution = self.get_distribution(obs)
        return self.value_net(obs), distribution.log_prob(actions), distribution.entropy()

    def get_distribution(self, obs: PyTorchObs) -> Distribution:
        """The distribution over goals."""
        assert isinstance(self.action_dist, CategoricalDistribution)
        return self.action_dist.proba_distribution(action_logits=self.action_net(obs))

    def predict_values(self, obs: PyTorchObs) -> Tensor:
        """Values of views."""
        values: Tensor = self.value_net(obs)
        return values
