"""`--quick`: the same command within a minute, with the same keys; its numbers mean nothing."""

from collections.abc import Callable, Sequence
from typing import Any, Final, TypeVar

from jsonargparse import ActionYesNo, ArgumentParser

T = TypeVar("T")
STEPS: Final = 12
"""Budget of an episode."""
ENV_OPTIONS: Final = {"camera": {"width_px": 48, "height_px": 48}}
"""Arguments of the environment."""


def add_quick_option(parser: ArgumentParser, what: str) -> None:
    """Add `--quick`.

    Args:
        parser: The command's parser.
        what: What is left of the command.
    """
    flag = ActionYesNo(yes_prefix="", no_prefix="no-")
    parser.add_argument("--quick", action=flag, default=False, help=f"{what}, but for what is given")


def env_options(options: Any) -> dict[str, Any]:
    """Arguments of the environment that a command was given, with `ENV_OPTIONS` below them if it is quick."""
    return (ENV_OPTIONS if options.quick else {}) | (options.env or {})


def parse_quick(parser: ArgumentParser, arguments: Sequence[str] | None, **quick: Any) -> Any:
    """Read a command line; under `--quick`, what is not given is that of a quick run.

    Args:
        parser: The command's parser; its defaults may be changed.
        arguments: Words of the command line; None for those of the process.
        quick: Defaults of a quick run.
    """
    options = parser.parse_args(arguments)
    if options.quick:
        parser.set_defaults(quick)
        options = parser.parse_args(arguments)
    return options


def parse_quick_settings(
    parser_of: Callable[[T], ArgumentParser], full: T, quick: T, arguments: Sequence[str] | None
) -> Any:
    """Read a command line whose defaults are settings, under `--quick` those of a run in a folder apart.

    Args:
        parser_of: Makes the command's parser from its defaults.
        full: The defaults.
        quick: Those of a quick run.
        arguments: Words of the command line; None for those of the process.

    Raises:
        ValueError: If a quick run is to be shipped.
    """
    options = parser_of(full).parse_args(arguments)
    if not options.quick:
        return options
    if options.install:
        raise ValueError("`--install` must not come with `--quick`: its networks have learned nothing")
    parser = parser_of(quick)
    parser.set_defaults(out=f"{parser.get_default('out')}-quick")
    return parser.parse_args(arguments)
