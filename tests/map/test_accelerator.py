"""The map on an accelerator, played on the CPU: what travels between the two is refused or counted."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_map

from anm_gym.map.neural_map import NeuralMap
from anm_gym.map.presets import map_settings
from anm_gym.map.settings import MapSettings

AWAY = "meta"
"""The device that plays the accelerator: torch knows it everywhere, and nothing can be computed there."""
FAMILIES = ("unit_norm", "delta_norm", "delta_weight", "laplace", "dropout")
QUERIES = np.random.default_rng(0).uniform(-2.0, 2.0, (64, 3)).astype(np.float32)


class AwayTensor(Tensor):
    """A tensor that says it is on the accelerator; its numbers are held here."""

    held: Tensor

    @staticmethod
    def __new__(cls, held: Tensor) -> "AwayTensor":
        layout = {"strides": held.stride(), "storage_offset": held.storage_offset(), "dtype": held.dtype}
        made: AwayTensor = Tensor._make_wrapper_subclass(cls, held.size(), device=AWAY, **layout)
        made.held = held
        return made

    def tolist(self) -> list[Any]:
        """Read all numbers, which torch refuses for subclasses."""
        return self.cpu().tolist()

    @classmethod
    def __torch_dispatch__(cls, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        raise RuntimeError(f"{func} was called outside of the accelerator's `with` block")


class Factories(TorchFunctionMode):
    """Make tensors from numbers here and send them, which torch does out of any mode's sight."""

    def __torch_function__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = dict(kwargs or {})
        if func in (torch.tensor, torch.as_tensor) and str(kwargs.get("device")) == AWAY:
            return func(*args, **kwargs | {"device": "cpu"}).to(AWAY)
        return func(*args, **kwargs)


class Accelerator(TorchDispatchMode):
    """Compute where the tensors are, and count what travels."""

    def __init__(self) -> None:
        super().__init__()
        self.trips: Counter[str] = Counter()
        self._factories = Factories()

    def __enter__(self) -> "Accelerator":
        self._factories.__enter__()
        super().__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        super().__exit__(*error)
        self._factories.__exit__(*error)

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = dict(kwargs or {})
        tensors: list[Tensor] = []
        tree_map(lambda value: tensors.append(value) if isinstance(value, Tensor) else None, (args, kwargs))
        away = [tensor for tensor in tensors if isinstance(tensor, AwayTensor)]
        here = [tensor for tensor in tensors if not isinstance(tensor, AwayTensor) and tensor.ndim > 0]
        goes_away = bool(away)
        if kwargs.get("device") is not None:
            goes_away = torch.device(kwargs["device"]).type == AWAY
            kwargs["device"] = "cpu"
            self.trips["down"] += bool(away) and not goes_away
            self.trips["up"] += bool(here) and goes_away
        elif away and here and func.name() != "aten::copy_":
            raise RuntimeError(f"{func} got tensors of two devices, {len(here)} of them from here")
        elif away and func.name() in ("aten::_local_scalar_dense", "aten::is_nonzero", "aten::equal"):
            self.trips["number"] += 1
            goes_away = False
        result = func(*tree_map(_held, args), **tree_map(_held, kwargs))
        if not goes_away:
            return result
        # What was changed in place stays the tensor that it was; anything else is a new one.
        same = {id(tensor.held): tensor for tensor in away} if func._schema.is_mutable else {}

        def sent(value: Any) -> Any:
            if id(value) in same:
                return same[id(value)]
            return AwayTensor(value) if isinstance(value, Tensor) else value

        return tree_map(sent, result)


def _held(value: Any) -> Any:
    return value.held if isinstance(value, AwayTensor) else value


@pytest.fixture
def accelerator(monkeypatch: pytest.MonkeyPatch) -> Iterator[Accelerator]:
    """An accelerator whose generators draw what those of the CPU do, without lower precision."""
    generator = torch.Generator

    class HostGenerator:
        def __new__(cls, _device: object = "cpu") -> torch.Generator:
            return generator()

    monkeypatch.setattr(torch, "Generator", HostGenerator)
    monkeypatch.setattr(torch, "autocast", lambda *_arguments, **_options: nullcontext())
    with Accelerator() as played:
        yield played


def small(preset: str, **schedule: Any) -> MapSettings:
    """A preset with a narrow network and few iterations."""
    settings = map_settings(preset)
    fewer = {"first_iterations": 8, "iterations": 2, "keyframe_iterations": 3} | schedule
    return replace(
        settings,
        field=replace(settings.field, width=32),
        schedule=replace(settings.schedule, bfloat16=False, **fewer),
    )


def learned(settings: MapSettings, tour: Any, device: str, frames: int = 6) -> NeuralMap:
    """A map of the first frames of the tour."""
    neural_map = NeuralMap(settings, tour.camera, seed=1, device=device)
    for depth, pose in zip(tour.depths[:frames], tour.poses[:frames], strict=True):
        neural_map.integrate(depth, pose)
    return neural_map


@pytest.mark.parametrize("preset", ["best", "paper"])
def test_map_on_an_accelerator_is_the_map_on_the_cpu(
    preset: str, tour: Any, accelerator: Accelerator
) -> None:
    settings = small(preset)
    here, away = learned(settings, tour, "cpu"), learned(settings, tour, AWAY)
    assert all(parameter.device.type == AWAY for parameter in away.field.parameters())
    for ask in ("sdf", "gradient", "variability", "posterior_std"):
        answers = [getattr(neural_map, ask)(QUERIES) for neural_map in (here, away)]
        np.testing.assert_allclose(answers[1], answers[0], rtol=1e-4, atol=1e-5, err_msg=ask)
    assert abs(len(here.mesh(0.1)) - len(away.mesh(0.1))) <= 2


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_scores_on_an_accelerator(family: str, tour: Any, accelerator: Accelerator) -> None:
    settings = map_settings("fast+dropout") if family == "dropout" else map_settings("fast")
    settings = replace(small("fast"), variability=replace(settings.variability, family=family, draws=4))
    if family == "dropout":
        settings = replace(settings, field=replace(settings.field, dropout=0.2))
    scores = learned(settings, tour, AWAY, frames=2).variability(QUERIES)
    assert scores.shape == (len(QUERIES),)
    assert (scores >= 0.0).all()
    assert scores.max() > 0.0


def test_state_of_an_accelerator_continues_there(tour: Any, accelerator: Accelerator) -> None:
    settings = small("best")
    first, second = learned(settings, tour, AWAY), NeuralMap(settings, tour.camera, device=AWAY)
    second.load_state(first.state())
    np.testing.assert_array_equal(second.sdf(QUERIES), first.sdf(QUERIES))
    second._occupancy = first._occupancy
    second.integrate(tour.depths[6], tour.poses[6])


@pytest.mark.parametrize("preset", ["best", "paper"])
def test_iterations_carry_nothing_between_host_and_accelerator(
    preset: str, tour: Any, accelerator: Accelerator
) -> None:
    trips = []
    for iterations in (2, 7):
        settings = small(preset, iterations=iterations, keyframe_iterations=iterations)
        accelerator.trips.clear()
        learned(settings, tour, AWAY, frames=3)
        trips.append((accelerator.trips["up"], accelerator.trips["down"]))
    assert trips[0] == trips[1]


def test_iterations_of_a_network_alone_read_no_number(tour: Any, accelerator: Accelerator) -> None:
    numbers = []
    for iterations in (2, 7):
        settings = small("paper", iterations=iterations, keyframe_iterations=iterations)
        accelerator.trips.clear()
        learned(settings, tour, AWAY, frames=3)
        numbers.append(accelerator.trips["number"])
    assert numbers[0] == numbers[1]


def test_mixed_devices_are_refused(accelerator: Accelerator) -> None:
    with pytest.raises(RuntimeError, match="two devices"):
        torch.ones(3, device=AWAY) + torch.ones(3)


@pytest.mark.gpu
def test_map_learns_a_room_on_a_gpu(tour: Any, room_distance: Callable[..., Any]) -> None:
    neural_map = learned(map_settings("fast"), tour, "cuda", frames=18)
    seen = neural_map.cloud.points[::20]
    assert np.abs(neural_map.sdf(seen)).mean() < 0.03
    assert len(neural_map.mesh(0.1).faces) > 1000
