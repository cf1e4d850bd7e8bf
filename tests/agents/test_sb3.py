"""Features for Stable-Baselines3: which parts of an observation they see, and how."""

import numpy as np
import pytest
import torch
from gymnasium import spaces

from agents.sb3 import ViewFeatures, goal_features

SPACE = spaces.Dict(
    {
        "ego_map": spaces.Box(0, 255, (3, 32, 32), np.uint8),
        "pointgoal_with_gps_compass": spaces.Box(-100.0, 100.0, (2,), np.float32),
        "gps": spaces.Box(-100.0, 100.0, (2,), np.float32),
    }
)


def batch(count: int = 4) -> dict[str, torch.Tensor]:
    generator = torch.Generator().manual_seed(0)
    return {
        key: torch.rand(count, *space.shape, generator=generator, requires_grad=True)
        for key, space in SPACE.spaces.items()
    }


def test_every_part_of_an_observation_reaches_the_features() -> None:
    torch.manual_seed(0)
    observations = batch()
    features = ViewFeatures(SPACE, features_dim=24)(observations)
    assert features.shape == (4, 24)
    features.sum().backward()
    assert all(value.grad is not None and value.grad.abs().sum() > 0 for value in observations.values())


def test_order_of_an_observation_does_not_matter() -> None:
    """A vector environment sorts the keys that it trains on; a single one does not."""
    features, observations = ViewFeatures(SPACE, features_dim=24), batch()
    shuffled = dict(reversed(observations.items()))
    assert torch.equal(features(observations), features(shuffled))


def test_goal_straight_behind_looks_the_same_from_either_side() -> None:
    left, right = goal_features(torch.tensor([[3.0, np.pi], [3.0, -np.pi]]))
    assert torch.allclose(left, right, atol=1e-6)


def test_far_goals_stay_in_range() -> None:
    near, far = goal_features(torch.tensor([[1.0, 0.0], [1000.0, 0.5]]))
    assert near[0] == pytest.approx(np.tanh(0.1))
    assert far.abs().max() <= 1.0


def test_tiny_images_are_refused() -> None:
    tiny = spaces.Dict({"depth_image": spaces.Box(0, 255, (1, 16, 16), np.uint8)})
    with pytest.raises(
        ValueError, match=r"`depth_image` must have edges of at least 28 pixels, got \(16, 16\)"
    ):
        ViewFeatures(tiny)
