"""Let one preset learn one recording, and count what that costs."""

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils.flop_counter import flop_registry
from tqdm import tqdm

from anm_gym.map.checkpoint import load_map, save_map
from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.settings import MapSettings
from benchmarks.recordings import Recording

COUNT_EVERY = 20
"""Every so manieth step is counted in FLOPs instead of being timed."""


@dataclass(frozen=True)
class LearningCost:
    """What learning cost, per step where the name says so."""

    steps: int
    """Images learned."""
    iterations: int
    """Optimiser steps in all."""
    cpu_ms_step: float
    """CPU milliseconds of the optimiser and of what feeds it."""
    observe_ms_step: float
    """CPU milliseconds of the logs beside the network: cloud, volume, floor, keyframe test."""
    wall_ms_step: float
    """Milliseconds on the clock, both together."""
    flops_step: float
    """Floating point operations of matrix products, keyframe test included; what grids gather and scatter is
    not counted. Not a number for a recording too short to be counted."""


@dataclass(frozen=True, eq=False)
class Learned:
    """A map at the end of a recording."""

    neural_map: NeuralMap
    """The map."""
    cost: LearningCost
    """What it took."""


class FlopCounter(TorchDispatchMode):
    """Add up the floating point operations of matrix products, backward passes included.

    torch's own counter follows modules by hooks that double backward passes do not allow.
    """

    def __init__(self) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self.flops = 0

    def __torch_dispatch__(
        self,
        func: Any,
        types: tuple[type, ...],
        args: tuple[Any, ...] = (),
        kwargs: dict[str, Any] | None = None,
    ) -> Any:
        """Run an operation and count it."""
        result = func(*args, **(kwargs or {}))
        count: Callable[..., int] | None = flop_registry.get(func._overloadpacket)
        if count is not None:
            self.flops += count(*args, **(kwargs or {}), out_val=result)
        return result


class _CostMeter:
    """Let a map learn image by image; a step is either timed or counted, as counting is slow."""

    def __init__(self, neural_map: NeuralMap) -> None:
        self._neural_map = neural_map
        self._steps = self._timed_steps = self._iterations = self._counted_iterations = self._flops = 0
        self._wall_s = self._learn_ms = self._observe_ms = 0.0

    def learn(self, depth_m: NDArray[np.float32], pose: NDArray[np.float64]) -> None:
        """Integrate the next image."""
        self._steps += 1
        if self._steps % COUNT_EVERY == 0:
            self._count(depth_m, pose)
        else:
            self._time(depth_m, pose)

    def cost(self) -> LearningCost:
        """Work out the cost of the images so far."""
        counted = self._counted_iterations
        flops_iteration = self._flops / counted if counted else float("nan")
        return LearningCost(
            steps=self._steps,
            iterations=self._iterations,
            cpu_ms_step=self._learn_ms / self._timed_steps,
            observe_ms_step=self._observe_ms / self._timed_steps,
            wall_ms_step=1000.0 * self._wall_s / self._timed_steps,
            flops_step=flops_iteration * self._iterations / self._steps,
        )

    def _count(self, depth_m: NDArray[np.float32], pose: NDArray[np.float64]) -> None:
        with FlopCounter() as counter:
            update = self._neural_map.integrate(depth_m, pose)
        self._flops += counter.flops
        self._counted_iterations += update.iterations
        self._iterations += update.iterations

    def _time(self, depth_m: NDArray[np.float32], pose: NDArray[np.float64]) -> None:
        before: Mapping[str, float] = dict(self._neural_map.stopwatch.compute_ms)
        start_s = time.perf_counter()
        update = self._neural_map.integrate(depth_m, pose)
        self._wall_s += time.perf_counter() - start_s
        after = self._neural_map.stopwatch.compute_ms
        self._learn_ms += after["learn"] - before.get("learn", 0.0)
        self._observe_ms += after["observe"] - before.get("observe", 0.0)
        self._timed_steps += 1
        self._iterations += update.iterations


def learn(recording: Recording, settings: MapSettings, seed: int = 0) -> Learned:
    """Integrate every image of a recording.

    Args:
        recording: The images.
        settings: The map's settings.
        seed: Seed of the map.

    Returns:
        The map and its cost; steps that are counted in FLOPs are left out of the times.
    """
    neural_map = NeuralMap(settings, recording.camera, seed=seed)
    meter = _CostMeter(neural_map)
    frames = zip(recording.depth_m, recording.world_from_camera, strict=True)
    label = f"{settings.preset} {recording.name}"
    for depth_m, pose in tqdm(frames, total=len(recording), desc=label, unit="step", delay=5.0, leave=False):
        meter.learn(depth_m, pose)
    return Learned(neural_map, meter.cost())


def learn_once(recording: Recording, settings: MapSettings, folder: Path) -> Learned:
    """Like `learn`, but keep the map in a folder and read it from there the next time.

    Args:
        recording: The images.
        settings: The map's settings; others make another file.
        folder: Where maps and costs are kept.

    Returns:
        The map and what it cost when it was learned.
    """
    stem = f"{recording.name}_{len(recording)}_{settings.preset}_{settings.settings_hash}".replace(":", "-")
    map_path, cost_path = folder / f"{stem}.safetensors", folder / f"{stem}.json"
    if not cost_path.exists():
        learned = learn(recording, settings)
        folder.mkdir(parents=True, exist_ok=True)
        save_map(learned.neural_map, map_path)
        cost_path.write_text(json.dumps(asdict(learned.cost)) + "\n", encoding="utf-8")
    # A map that was just learned is read back too, so that no number depends on when that was.
    return Learned(load_map(map_path), LearningCost(**json.loads(cost_path.read_text(encoding="utf-8"))))
