"""Option names on the command line: dashes, whatever the settings behind them are called.

Apart from `train.command`, which knows no parser.
"""

from typing import Final

from jsonargparse import ArgumentParser

PRINT_CONFIG: Final = "print_config"
"""The option that jsonargparse adds to parsers with a YAML file."""


def spell_with_dashes(parser: ArgumentParser) -> ArgumentParser:
    """Give every option dashes for underscores; the spelling with underscores goes on to work.

    `add_class_arguments` names options after the fields of dataclasses. In a YAML file the names stay those
    of the fields.

    Args:
        parser: With all its options; it is changed.

    Returns:
        The same parser.

    Example:
        >>> parser = ArgumentParser()
        >>> _ = parser.add_argument("--eval_scenes", default="")
        >>> spell_with_dashes(parser).parse_args(["--eval-scenes", "home:flat:1"]).eval_scenes
        'home:flat:1'
        >>> _ = parser.add_argument("--test-scenes", default="")
        >>> spell_with_dashes(parser).parse_args(["--test_scenes", "home:flat:2"]).test_scenes
        'home:flat:2'
    """
    for action in parser._actions:
        if action.dest == PRINT_CONFIG:
            continue  # the library looks for its name among the words
        dashed = [name.replace("_", "-") for name in action.option_strings]
        underscored = [_underscored(name) for name in dashed if name.startswith("--")]
        if dashed != underscored:
            action.option_strings = dashed
            parser._option_string_actions.update(dict.fromkeys([*dashed, *underscored], action))
    return parser


def _underscored(name: str) -> str:
    """The spelling with underscores, but for the dashes by which the library tells no from yes."""
    prefix = "--no-" if name.startswith("--no-") else "--"
    return prefix + name.removeprefix(prefix).replace("-", "_")
