"""Learning from batches that are drawn by their number, in checkpoints that a killed run goes on from.

What is learned, and from what, is in the packages of the learned baselines.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, Generic, Protocol, TypeVar

import numpy as np
from torch import Tensor, nn, optim
from tqdm import tqdm

from train.progress_file import load_progress, save_progress
from train.run_clock import RunClock

CURVE_BATCHES: Final = 50
"""Batches whose mean loss is a point of the curve."""
CHECKPOINT_S: Final = 20.0
"""Seconds between two checkpoints."""
DataT = TypeVar("DataT")


class Learner(Protocol):
    """What learns in steps and can be kept."""

    num_done: int

    def save(self, path: Path) -> None:
        """Keep where it stands."""


class BatchLearner(ABC, Generic[DataT]):
    """Networks while they learn.

    Args:
        nets: Networks by name.
        optimizer: Adam over their parameters.
        num_batches: Gradient steps.
        max_gradient: Norm at which gradients are cut.
    """

    def __init__(
        self,
        nets: Mapping[str, nn.Module],
        optimizer: optim.Optimizer,
        num_batches: int,
        max_gradient: float = float("inf"),
    ) -> None:
        self._nets, self.optimizer = nets, optimizer
        self._num_batches, self._max_gradient = num_batches, max_gradient
        self.num_done, self.curve = 0, list[float]()
        """Batches so far, and the mean loss of each fifty."""
        self._losses: list[float] = []

    def learn(self, data: DataT) -> Iterator[float]:
        """Take the gradient steps that remain; yields the loss of each."""
        while self.num_done < self._num_batches:
            for net in self._nets.values():
                net.train()
            self._set_learning_rate()
            loss = self._loss(data)
            self.optimizer.zero_grad()
            loss.backward()
            if np.isfinite(self._max_gradient):
                parameters = [values for net in self._nets.values() for values in net.parameters()]
                nn.utils.clip_grad_norm_(parameters, self._max_gradient)
            self.optimizer.step()
            self.num_done += 1
            self._note(loss.item())
            yield loss.item()

    def save(self, path: Path) -> None:
        """Keep networks, optimiser and curve; the file appears whole or not at all."""
        progress = {"num_done": self.num_done, "curve": self.curve, "losses": self._losses}
        save_progress(path, self._nets, self.optimizer, progress)

    def load(self, path: Path) -> None:
        """Go back to what `save` kept."""
        progress = load_progress(path, self._nets, self.optimizer)
        self.num_done, self.curve, self._losses = (progress[k] for k in ("num_done", "curve", "losses"))

    @abstractmethod
    def _loss(self, data: DataT) -> Tensor:
        """The loss of the next batch, which `num_done` decides."""

    @abstractmethod
    def _learning_rate(self, done_share: float) -> float:
        """The learning rate when a share of the batches is done."""

    def _set_learning_rate(self) -> None:
        for group in self.optimizer.param_groups:
            group["lr"] = self._learning_rate(self.num_done / self._num_batches)

    def _note(self, loss: float) -> None:
        self._losses.append(loss)
        if len(self._losses) == CURVE_BATCHES or self.num_done == self._num_batches:
            self.curve.append(float(np.mean(self._losses)))
            self._losses = []


def follow(
    learner: Learner,
    steps: Iterator[Any],
    total: int,
    path: Path,
    clock: RunClock,
    *,
    title: str,
    unit: str = "batch",
) -> None:
    """Take the steps that remain, with a bar that tells when it ends and checkpoints now and then.

    Args:
        learner: What learns.
        steps: Its steps; each yields a loss, or a point of a curve with `gain_m2`.
        total: Number of steps, those that are done too.
        path: The checkpoint.
        clock: Kept with it.
        title: What the bar says.
        unit: What a step is.
    """
    bar = tqdm(steps, total=total, initial=learner.num_done, desc=title, unit=unit)
    saved_s = time.monotonic()
    for point in bar:
        if time.monotonic() - saved_s > CHECKPOINT_S:
            text = f"{point['gain_m2']:.1f} m2" if isinstance(point, dict) else f"loss {point:.3f}"
            bar.set_postfix_str(text)
            learner.save(path)
            clock.keep()
            saved_s = time.monotonic()
    learner.save(path)
    clock.keep()
