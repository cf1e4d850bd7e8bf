"""No settings take a number that means nothing: whoever mistypes one is told so where it is given."""

import pkgutil
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from importlib import import_module
from typing import Any

import pytest

import agents
import anm_gym
import train
from agents.rollouts import RolloutSettings
from anm_gym.map.presets import map_settings
from anm_gym.wrappers.frontier_goal import PRESETS as FRONTIERS

KINDS = ("Settings", "Learning", "Spec", "Limits", "Weights", "Range", "Training")
"""How classes of settings are called."""
ELSEWHERE = {
    *(("MeshEnvSettings", name) for name in ("forward_step_m", "turn_step_deg")),
    *(("GoalRange", name) for name in ("min_m", "max_m")),
}
"""The simulator refuses the former; the latter are called as the environment's arguments are."""
ANYTHING = {("SurfaceSettings", "doubt_visibility")}
"""Below 0 all surface is doubted, above 1 none."""


def settings() -> Iterator[Any]:
    """One of each kind of settings, as its defaults make it; of those without, one that is in use."""
    yield from (FRONTIERS["strong"], RolloutSettings(0.25, 0.5), *map_settings("best").field.grids)
    for package in (anm_gym, agents, train):
        for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
            if not module.name.endswith("__main__"):
                yield from made_in(import_module(module.name))


def made_in(module: Any) -> Iterator[Any]:
    for name, kind in vars(module).items():
        is_own = is_dataclass(kind) and kind.__module__ == module.__name__
        if is_own and name.endswith(KINDS) and not name.startswith("_"):
            try:
                yield kind()  # type: ignore[operator]
            except TypeError:  # it has no defaults
                continue


@pytest.mark.parametrize("wrong", [-1, float("nan")])
def test_numbers_out_of_range_are_refused(wrong: float) -> None:
    taken, every = [], list(settings())
    for each in every:
        for field in fields(each):
            key, value = (type(each).__name__, field.name), getattr(each, field.name)
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if is_number and key not in ELSEWHERE | ANYTHING and not refuses(each, field.name, wrong):
                taken.append(key)
    assert len(every) > 50
    assert not taken


def refuses(settings: Any, name: str, value: float) -> bool:
    """Whether a value is refused by an error that names it."""
    try:
        replace(settings, **{name: value})
    except (ValueError, TypeError) as error:
        return name in str(error)
    return False
