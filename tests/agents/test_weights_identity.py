import torch
from torch import nn

from agents.weights_identity import weights_digest


def test_digest_changes_with_any_weight_and_only_then() -> None:
    net, other = nn.Linear(3, 2), nn.Linear(3, 2)
    other.load_state_dict(net.state_dict())
    assert weights_digest([net]) == weights_digest([other])
    with torch.no_grad():
        other.bias[1] += 1e-3
    assert weights_digest([net]) != weights_digest([other])
