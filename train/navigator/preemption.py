"""Stragglers do not hold the others up: who is late breaks its rollout off (DD-PPO)."""

import os
from typing import Final, final

import torch
from torch import distributed
from torch.distributed import TCPStore  # type: ignore[attr-defined]

from train.navigator.ranks import TIMEOUT, Ranks

FINISHED_SHARE: Final = 0.6
"""Share of the processes that must have finished their rollouts before others break theirs off (DD-PPO)."""
LEAST_SHARE: Final = 0.25
"""Share of its own rollout that a process has at least (DD-PPO)."""


@final
class Preemption:
    """Count who has finished, in a store that all processes reach.

    Args:
        ranks: The processes; one alone is never preempted.

    Source:
        Wijmans et al., DD-PPO, ICLR 2020.
    """

    def __init__(self, ranks: Ranks) -> None:
        self._ranks, self._iteration = ranks, 0
        self._store = _open_store(ranks) if ranks.world > 1 else None

    def begin(self) -> None:
        """A rollout begins; every process calls this as often."""
        self._iteration += 1

    def finish(self) -> None:
        """This process has finished its rollout."""
        if self._store is not None:
            self._store.add(self._key, 1)

    def is_late(self, done_share: float) -> bool:
        """Tell whether to break the rollout off.

        Args:
            done_share: Share of this process's rollout that is done.
        """
        if self._store is None or done_share < LEAST_SHARE:
            return False
        finished: int = self._store.add(self._key, 0)
        return finished >= FINISHED_SHARE * self._ranks.world

    @property
    def _key(self) -> str:
        # A fresh key per rollout: a counter that is set back races with those who still read it.
        return f"finished/{self._iteration}"


def _open_store(ranks: Ranks) -> TCPStore:
    """The first process opens a port and tells the others."""
    host = os.environ["MASTER_ADDR"]
    port = torch.zeros(1, dtype=torch.int64)
    if ranks.is_first:
        store = TCPStore(host, 0, is_master=True, wait_for_workers=False, timeout=TIMEOUT)
        port[0] = store.port
        distributed.broadcast(port, src=0)
        return store
    distributed.broadcast(port, src=0)
    return TCPStore(host, int(port), is_master=False, timeout=TIMEOUT)
