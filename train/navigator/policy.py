"""The navigator's network as a recurrent policy of Stable-Baselines3.

Two things are done otherwise than in the library, and both are most of the speed: the encoder sees
real frames only, and the LSTM runs over whole episodes in one call. And as in DD-PPO, actor and critic
share one LSTM through which both gradients flow; the library stops the critic's.
"""

from typing import Any, final

import torch
from gymnasium import spaces
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy
from sb3_contrib.common.recurrent.type_aliases import RNNStates
from stable_baselines3.common.distributions import Distribution
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.type_aliases import Schedule
from torch import Tensor

from agents.navigator_net import (
    NavigatorEncoder,
    NavigatorNet,
    NavigatorNetSettings,
    State,
    initialise_heads,
    run_lstm,
    step_lstm,
)

Observation = dict[str, Tensor]


@final
class NavigatorExtractor(BaseFeaturesExtractor):
    """The network's encoder in the library's terms.

    Args:
        observation_space: Of `NavigationVecEnv`.
        net: Sizes.
    """

    def __init__(self, observation_space: spaces.Dict, net: NavigatorNetSettings) -> None:
        encoder = NavigatorEncoder(net)
        super().__init__(observation_space, features_dim=encoder.features)
        self.encoder = encoder

    def forward(self, observations: Observation) -> Tensor:
        """Encode (B, ...) observations to (B, features)."""
        features: Tensor = self.encoder(observations)
        return features


@final
class NavigatorPolicy(RecurrentActorCriticPolicy):
    """Encoder, one LSTM, actor and critic.

    Args:
        observation_space: Of `NavigationVecEnv`.
        action_space: `Discrete(4)`.
        lr_schedule: Learning rate by the share of training that remains.
        net: Sizes of the network.
        kwargs: What the library adds.
    """

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        lr_schedule: Schedule,
        net: NavigatorNetSettings,
        **kwargs: Any,
    ) -> None:
        super().__init__(
            observation_space,
            action_space,
            lr_schedule,
            net_arch=[],
            ortho_init=False,
            features_extractor_class=NavigatorExtractor,
            features_extractor_kwargs={"net": net},
            normalize_images=False,
            lstm_hidden_size=net.lstm_size,
            n_lstm_layers=net.lstm_layers,
            shared_lstm=True,
            enable_critic_lstm=False,
            optimizer_kwargs={"eps": 1e-5},
            **kwargs,
        )
        self.net_settings = net
        initialise_heads(self.lstm_actor, self.action_net, self.value_net)

    def forward(
        self, obs: Observation, lstm_states: RNNStates, episode_starts: Tensor, deterministic: bool = False
    ) -> tuple[Tensor, Tensor, Tensor, RNNStates]:
        """Choose actions for one frame of every agent; see the library."""
        latent, state = self._step(obs, lstm_states.pi, episode_starts)
        distribution = self._get_action_dist_from_latent(latent)
        actions = distribution.get_actions(deterministic=deterministic)
        return actions, self.value_net(latent), distribution.log_prob(actions), RNNStates(state, state)

    def evaluate_actions(
        self, obs: Observation, actions: Tensor, lstm_states: RNNStates, episode_starts: Tensor
    ) -> tuple[Tensor, Tensor, Tensor | None]:
        """Judge actions in whole sequences, as `EnvironmentBuffer` hands them out; see the library."""
        latent = run_lstm(self.lstm_actor, self.features_extractor(obs), lstm_states.pi, episode_starts)
        distribution = self._get_action_dist_from_latent(latent)
        return self.value_net(latent), distribution.log_prob(actions), distribution.entropy()

    def predict_values(self, obs: Observation, lstm_states: State, episode_starts: Tensor) -> Tensor:
        """Value of one frame of every agent; see the library."""
        values: Tensor = self.value_net(self._step(obs, lstm_states, episode_starts)[0])
        return values

    def get_distribution(
        self, obs: Observation, lstm_states: State, episode_starts: Tensor
    ) -> tuple[Distribution, State]:
        """Distribution of the actions for one frame of every agent; see the library."""
        latent, state = self._step(obs, lstm_states, episode_starts)
        return self._get_action_dist_from_latent(latent), state

    def load_net(self, net: NavigatorNet) -> None:
        """Take the weights of a plain network over."""
        self._encoder.load_state_dict(net.encoder.state_dict())
        self.lstm_actor.load_state_dict(net.lstm.state_dict())
        self.action_net.load_state_dict(net.actor.state_dict())
        self.value_net.load_state_dict(net.critic.state_dict())

    @torch.no_grad()
    def as_net(self) -> NavigatorNet:
        """Copy the weights to a plain network."""
        net = NavigatorNet(self.net_settings)
        net.encoder.load_state_dict(self._encoder.state_dict())
        net.lstm.load_state_dict(self.lstm_actor.state_dict())
        net.actor.load_state_dict(self.action_net.state_dict())
        net.critic.load_state_dict(self.value_net.state_dict())
        return net

    def learn_values_only(self, is_on: bool) -> None:
        """Hold everything but the critic, whose first errors would spoil what imitation has taught."""
        for parameter in self.parameters():
            parameter.requires_grad_(not is_on)
        for parameter in self.value_net.parameters():
            parameter.requires_grad_(True)

    @property
    def _encoder(self) -> NavigatorEncoder:
        assert isinstance(self.features_extractor, NavigatorExtractor)
        return self.features_extractor.encoder

    def _step(self, obs: Observation, state: State, starts: Tensor) -> tuple[Tensor, State]:
        return step_lstm(self.lstm_actor, self.features_extractor(obs), state, starts)
