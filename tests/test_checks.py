from dataclasses import dataclass
from typing import Literal

import pytest

from anm_gym.checks import check_at_least, check_choices, check_positive, check_share

Colour = Literal["red", "green"]


@dataclass(frozen=True)
class Paint:
    colour: Colour = "red"
    litres: float = 1.0
    coats: int = 2


def test_settings_in_range_pass() -> None:
    check_choices(Paint())
    check_positive(Paint(), "litres", "coats")
    check_at_least(Paint(), 2, "coats")


def test_misspelled_choice_is_refused_with_the_choices() -> None:
    with pytest.raises(ValueError, match="`colour` must be one of red, green, got 'gren'"):
        check_choices(Paint(colour="gren"))  # type: ignore[arg-type]


@pytest.mark.parametrize("litres", [0.0, -1.0, float("nan")])
def test_numbers_that_are_not_positive_are_refused(litres: float) -> None:
    with pytest.raises(ValueError, match="`litres` must be > 0, got"):
        check_positive(Paint(litres=litres), "litres")


@pytest.mark.parametrize("coats", [1, float("nan")])
def test_numbers_below_the_bound_are_refused(coats: int) -> None:
    with pytest.raises(ValueError, match="`coats` must be >= 2, got"):
        check_at_least(Paint(coats=coats), 2, "coats")


@pytest.mark.parametrize("litres", [-0.1, 1.1, float("nan")])
def test_numbers_that_are_no_share_are_refused(litres: float) -> None:
    check_share(Paint(litres=1.0), "litres")
    with pytest.raises(ValueError, match=r"`litres` must be in \[0, 1\], got"):
        check_share(Paint(litres=litres), "litres")
