"""The processes that `torchrun` starts: who one is, and what all of them agree on."""

import importlib
import os
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import timedelta

import torch
from torch import Tensor, distributed, nn

TIMEOUT = timedelta(minutes=30)
"""A process that waits longer for the others gives up."""


@dataclass(frozen=True)
class Ranks:
    """This process among all that train together."""

    rank: int = 0
    """Number of this process; 0 logs and saves."""
    world: int = 1
    """How many there are."""

    @classmethod
    def join(cls) -> "Ranks":
        """Join the processes of `torchrun`; without it there is one."""
        world = int(os.environ.get("WORLD_SIZE", "1"))
        if world == 1:
            return cls()
        if not distributed.is_initialized():
            # Optimisers import this at their first step. Imported while there is a group, it holds the group
            # for ever, whose threads then outlive `leave` and now and then abort the process as it ends.
            importlib.import_module("torch._dynamo")
            distributed.init_process_group("gloo", timeout=TIMEOUT)
        return cls(distributed.get_rank(), world)

    def leave(self) -> None:
        """Leave the group."""
        if self.world > 1 and distributed.is_initialized():
            distributed.destroy_process_group()

    @property
    def is_first(self) -> bool:
        """Whether this process logs and saves."""
        return self.rank == 0

    def synchronise(self, module: nn.Module) -> None:
        """Give all processes the weights of the first."""
        if self.world > 1:
            for tensor in [*module.parameters(), *module.buffers()]:
                distributed.broadcast(tensor.data, src=0)

    def average_gradients(self, parameters: Iterable[Tensor]) -> None:
        """Replace every gradient by its mean over the processes, in one message."""
        if self.world == 1:
            return
        gradients = [values.grad for values in parameters if values.grad is not None]
        flat = torch.cat([gradient.reshape(-1) for gradient in gradients])
        distributed.all_reduce(flat)
        parts = (flat / self.world).split([gradient.numel() for gradient in gradients])
        for gradient, mean in zip(gradients, parts, strict=True):
            gradient.copy_(mean.view_as(gradient))

    def total(self, *values: float) -> list[float]:
        """Sum numbers over the processes; all get the same, so all decide alike."""
        sums = torch.tensor(values, dtype=torch.float64)
        if self.world > 1:
            distributed.all_reduce(sums)
        return [float(value) for value in sums]
