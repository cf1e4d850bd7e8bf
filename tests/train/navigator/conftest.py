"""Small navigators in small homes."""

from collections.abc import Callable
from typing import Any

import pytest

from agents.ego_memory import EgoMemorySettings
from agents.navigator_net import NavigatorNetSettings
from train.navigator.env import DomainSettings, NavigationVecEnv


@pytest.fixture(scope="session")
def tiny_net() -> NavigatorNetSettings:
    """Give the sizes of a network of few units."""
    return NavigatorNetSettings(
        image_px=48, lstm_size=8, memory=EgoMemorySettings(crop_cells=20, image_px=24)
    )


@pytest.fixture
def navigation(tiny_net: NavigatorNetSettings) -> Callable[..., NavigationVecEnv]:
    """Give `navigation(num_agents, **domain)`: agents in studios."""

    def make(num_agents: int = 2, seed: int = 0, **domain: Any) -> NavigationVecEnv:
        settings = DomainSettings(tiers={"studio": 1.0}, **domain)
        return NavigationVecEnv(tiny_net, settings, num_agents, seed)

    return make
