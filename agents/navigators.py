"""Every navigator by name: who turns goals into actions."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import gymnasium
from gymnasium import spaces

from agents.learned_navigator import PLUS, STAR, DDPPONavigator, LearnedSettings
from agents.navigator import Navigator
from agents.planning_navigators import OracleNavigator, PlannerNavigator
from anm_gym.actions import Action
from anm_gym.checks import check_known
from anm_gym.wrappers.goal import GoalWrapper


def _seat(settings: LearnedSettings) -> Callable[[GoalWrapper, int], Navigator]:
    return lambda env, seed: DDPPONavigator(env, settings, seed)


LEARNED: Final[dict[str, LearnedSettings]] = {
    "ddppo": PLUS,
    "ddppo-plus": PLUS,
    "ddppo-star": STAR,
    "ddppo-paper": replace(PLUS, resets_memory=False, has_reflexes=False, stop="random"),
    "ddppo+fallback": replace(PLUS, hands_over=True),
}
"""Those with a network, and how it is used. `ddppo` is `ddppo-plus`; `ddppo-paper` treats new goals and stops
as the released code does; `ddppo+fallback` hands over to the planner where it is stuck."""
NAVIGATORS: Final[dict[str, Callable[[GoalWrapper, int], Navigator]]] = {
    "planner": lambda env, seed: PlannerNavigator(env, seed=seed),
    "oracle": lambda env, seed: OracleNavigator(env, seed=seed),
    **{name: _seat(settings) for name, settings in LEARNED.items()},
}
"""All navigators."""


def make_navigator(name: str, env: gymnasium.Env[Any, Any], seed: int = 0) -> Navigator:
    """Build a navigator by name.

    Args:
        name: One of `NAVIGATORS`.
        env: An environment whose outermost layer is a `GoalWrapper`.
        seed: Seeds what the navigator draws.

    Raises:
        ValueError: If there is no such navigator, or the environment has other actions.
        TypeError: If the environment is not under a `GoalWrapper`.
        PolicyError: If the weights of a learned one cannot be read.
    """
    check_known("navigator", name, NAVIGATORS)
    if not isinstance(env, GoalWrapper):
        raise TypeError(f"`env` must be wrapped in a GoalWrapper, got {type(env).__name__}")
    if not isinstance(env.action_space, spaces.Discrete) or env.action_space.n != len(Action):
        raise ValueError(
            f"`env` must have the {len(Action)} actions of ANM/Explore-v0, got {env.action_space}"
        )
    return NAVIGATORS[name](env, seed)
