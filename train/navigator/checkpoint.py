"""Where a training run stands, on disk: weights and optimiser as safetensors, the rest as JSON."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, final

import torch
from torch import Tensor, nn

from anm_gym.errors import PolicyError
from train.progress_file import read_checkpoint, write_checkpoint

_MODULE, _OPTIMIZER = "module/", "optimizer/"


@dataclass
class Progress:
    """Where a run stands."""

    stage: str
    """Name of the stage that is under way."""
    frames: int = 0
    """Frames of this stage."""
    cpu_s: float = 0.0
    """CPU time that the run has taken so far, seconds."""
    curve: list[dict[str, Any]] = field(default_factory=list)
    """What the evaluations came to."""


@final
class TrainingCheckpoint:
    """One file that a run leaves behind and goes on from.

    Args:
        path: A ``.safetensors`` file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def save(self, module: nn.Module, optimizer: torch.optim.Optimizer, progress: Progress) -> None:
        """Write where the run stands; the file appears whole or not at all."""
        tensors = {_MODULE + name: values for name, values in module.state_dict().items()}
        for index, values in optimizer.state_dict()["state"].items():
            tensors |= {
                f"{_OPTIMIZER}{index}/{name}": torch.as_tensor(value) for name, value in values.items()
            }
        write_checkpoint(self.path, tensors, vars(progress))

    def progress(self) -> Progress | None:
        """Where the run stands; None before the first checkpoint.

        Raises:
            PolicyError: If the file cannot be read.
        """
        if not self.path.exists():
            return None
        return Progress(**read_checkpoint(self.path)[1])

    def restore(self, module: nn.Module, optimizer: torch.optim.Optimizer) -> None:
        """Give weights and optimiser back what was saved.

        Raises:
            PolicyError: If the file cannot be read or does not fit.
        """
        tensors, _ = read_checkpoint(self.path)
        moments: dict[int, dict[str, Tensor]] = {}
        for name, values in tensors.items():
            if name.startswith(_OPTIMIZER):
                index, key = name.removeprefix(_OPTIMIZER).split("/")
                moments.setdefault(int(index), {})[key] = values
        weights = {
            name.removeprefix(_MODULE): values for name, values in tensors.items() if name.startswith(_MODULE)
        }
        try:
            module.load_state_dict(weights)
            optimizer.load_state_dict({**optimizer.state_dict(), "state": moments})
        except (RuntimeError, ValueError) as error:
            raise PolicyError(f"the checkpoint {self.path} must fit the settings, got {error}") from error
