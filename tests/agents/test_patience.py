"""When an agent that comes no nearer is led."""

import numpy as np

from agents.patience import NEARER_M, PATIENCE_M, Patience

STEP_M = 0.25
LIMIT = int(PATIENCE_M / STEP_M)


def after(patience: Patience, distances_m: list[float]) -> list[bool]:
    """Whether patience with the first agent is over after each of its distances."""
    over = []
    for distance_m in distances_m:
        patience.update(np.full(len(patience.is_over), distance_m))
        over.append(bool(patience.is_over[0]))
    return over


def test_patience_is_over_for_as_long_as_it_lasts() -> None:
    over = after(Patience(np.array([STEP_M])), [3.0] * (4 * LIMIT + 1))
    assert over == ([False] * LIMIT + [True] * LIMIT) * 2 + [False]


def test_agent_that_comes_nearer_has_patience_anew() -> None:
    patience = Patience(np.array([STEP_M]))
    assert not any(after(patience, [3.0] * LIMIT))
    assert not any(after(patience, [3.0 - 2.0 * NEARER_M] * LIMIT))
    assert after(patience, [3.0 - 2.5 * NEARER_M]) == [True]


def test_led_agent_is_led_on_when_it_comes_nearer() -> None:
    """What leads it has just begun to help."""
    patience = Patience(np.array([STEP_M]))
    after(patience, [3.0] * (LIMIT + 1))
    assert after(patience, [2.0, 1.0]) == [True, True]


def test_short_steps_have_more_patience_and_a_new_goal_has_it_anew() -> None:
    patience = Patience(np.array([0.065, STEP_M]))
    after(patience, [3.0] * (LIMIT + 1))
    assert patience.is_over.tolist() == [False, True]
    patience.keep([1, 0])
    assert patience.is_over.tolist() == [True, False]
    patience.begin_goal(0)
    assert patience.is_over.tolist() == [False, False]
    assert not any(after(patience, [9.0] * LIMIT)), "farther from a new goal is not a step back"
