"""The optimiser's moments as named tensors, so that a saved map learns on as if nothing had happened."""

from torch import Tensor, nn
from torch.optim import Optimizer


def moments(optimizer: Optimizer, network: nn.Module) -> dict[str, Tensor]:
    """What an optimiser keeps of each parameter of a network, by ``parameter:key``.

    Returns:
        Its own tensors, not copies; none before the first iteration.
    """
    return {
        f"{name}:{key}": value
        for name, parameter in network.named_parameters()
        for key, value in optimizer.state.get(parameter, {}).items()
    }


def load_moments(optimizer: Optimizer, network: nn.Module, saved: dict[str, Tensor]) -> None:
    """Replace what an optimiser keeps by what `moments` returned.

    Raises:
        KeyError: If the network has no such parameter.
    """
    optimizer.state.clear()
    named = dict(network.named_parameters())
    for label, value in saved.items():
        name, key = label.rsplit(":", 1)
        optimizer.state[named[name]][key] = value
