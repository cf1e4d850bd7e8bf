"""Draws of an agent that are not those of its environment, though both were given the same seed."""

from typing import Final

import numpy as np

_AGENTS: Final = 1
"""Sets the streams of agents apart from those that a seed alone begins."""


def draws_of(seed: int) -> np.random.Generator:
    """The draws of an agent, which are not those that `reset` of an environment makes of the same seed."""
    return np.random.default_rng([_AGENTS, seed])
