"""Checks that settings share: a misspelled choice must not run something else."""

from collections.abc import Collection
from functools import cache
from typing import Any, Literal, get_args, get_origin, get_type_hints


def check_choices(settings: Any) -> None:
    """Refuse settings with a value that is none of those its field allows.

    Args:
        settings: A dataclass; fields of type `Literal` are checked.

    Raises:
        ValueError: If there is such a value; the message lists the choices.
    """
    kind: Any = type(settings)
    for name, choices in _choices_of(kind).items():
        value = getattr(settings, name)
        if value not in choices:
            raise ValueError(f"`{name}` must be one of {', '.join(map(str, choices))}, got {value!r}")


@cache
def _choices_of(kind: type) -> dict[str, tuple[Any, ...]]:
    """The allowed values of each field that has a `Literal`; kept, as settings are made while maps learn."""
    hints = get_type_hints(kind)
    return {name: get_args(hint) for name, hint in hints.items() if get_origin(hint) is Literal}


def check_known(kind: str, name: str, known: Collection[str]) -> None:
    """Refuse a name that there is not.

    Args:
        kind: What the name is of, such as "map preset".
        name: The name.
        known: Those that there are.

    Raises:
        ValueError: If it is none of them; the message lists them.
    """
    if name not in known:
        raise ValueError(f"unknown {kind} {name!r}; choose one of: {', '.join(known)}")


def check_at_least(settings: Any, low: float, *names: str) -> None:
    """Refuse settings with a number below a bound, or none at all.

    Args:
        settings: Any object.
        low: The bound.
        names: Attributes to be checked.

    Raises:
        ValueError: If one of them is less than the bound or not a number.
    """
    for name in names:
        value = getattr(settings, name)
        if not value >= low:
            raise ValueError(f"`{name}` must be >= {low:g}, got {value}")


def check_positive(settings: Any, *names: str) -> None:
    """Refuse settings with a number that is not more than 0; see `check_at_least`."""
    for name in names:
        value = getattr(settings, name)
        if not value > 0.0:
            raise ValueError(f"`{name}` must be > 0, got {value}")


def check_share(settings: Any, *names: str) -> None:
    """Refuse settings with a number outside of [0, 1]; see `check_at_least`."""
    for name in names:
        value = getattr(settings, name)
        if not 0.0 <= value <= 1.0:
            raise ValueError(f"`{name}` must be in [0, 1], got {value}")
