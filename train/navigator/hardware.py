"""Where a training run computes: apart from its settings, since a run may go on elsewhere."""

import os
from dataclasses import asdict, dataclass, replace

from anm_gym.checks import check_known
from anm_gym.map.numerics import usable_device
from anm_gym.sim.backends import BACKENDS


@dataclass(frozen=True)
class Hardware:
    """What the networks learn on, and what draws the depth images of training."""

    device: str = "cpu"
    """Where the networks live: `cpu`, `cuda` or `cuda:1`; see `of_process` for several processes."""
    backend: str = "embree"
    """What casts the rays: `embree` on the CPU, or `warp` on the device."""

    def __post_init__(self) -> None:
        usable_device(self.device)
        check_known("backend", self.backend, BACKENDS)

    def of_process(self) -> "Hardware":
        """Give each process that `torchrun` starts on a machine a GPU of its own, where none is named.

        Raises:
            ValueError: If the machine has fewer GPUs than processes.
        """
        if self.device != "cuda" or int(os.environ.get("WORLD_SIZE", "1")) == 1:
            return self
        return replace(self, device=f"cuda:{os.environ.get('LOCAL_RANK', '0')}")

    @property
    def camera_device(self) -> str:
        """Where the rays are cast."""
        return self.device if self.backend == "warp" else "cpu"

    def as_dict(self) -> dict[str, str]:
        """Plain values for a file."""
        return asdict(self)
