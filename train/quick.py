"""`--quick`: the same command within a minute, with the same keys; its numbers mean nothing."""

from collections.abc import Sequence
from typing import Any, Final

from jsonargparse import ActionYesNo, ArgumentParser

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
