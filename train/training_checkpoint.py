"""Where a training run stands, on disk: weights and optimiser as safetensors, the rest as JSON."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, final

import torch
from torch import nn

from train.progress_file import load_progress, read_checkpoint, save_progress

_MODULE: Final = "module"


@dataclass
class Progress:
    """Where a run stands."""

    stage: str
    """Name of the stage that is under way."""
    frames: int = 0
    """Frames of this stage."""
    cpu_s: float = 0.0
    """CPU time that the run has taken so far in the process that saves, seconds."""
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
        save_progress(self.path, {_MODULE: module}, optimizer, vars(progress))

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
        load_progress(self.path, {_MODULE: module}, optimizer)
