from argparse import ArgumentError

import pytest
from jsonargparse import ActionYesNo, ArgumentParser

from train.option_names import spell_with_dashes


def make_parser() -> ArgumentParser:
    parser = ArgumentParser(exit_on_error=False)
    parser.add_argument("--config", action="config")
    parser.add_argument("--eval_scenes", default="none")
    parser.add_argument("--learner.num_envs", type=int, default=1)
    return spell_with_dashes(parser)


def test_both_spellings_are_understood() -> None:
    for words in (
        ["--eval-scenes", "a", "--learner.num-envs=2"],
        ["--eval_scenes=a", "--learner.num_envs", "2"],
    ):
        options = make_parser().parse_args(words)
        assert (options.eval_scenes, options.learner.num_envs) == ("a", 2)


def test_no_stays_no() -> None:
    parser = ArgumentParser(exit_on_error=False)
    parser.add_argument("--at_once", action=ActionYesNo(yes_prefix="", no_prefix="no-"), default=True)
    spell_with_dashes(parser)
    for words, value in (
        ([], True),
        (["--no-at-once"], False),
        (["--no-at_once"], False),
        (["--at_once"], True),
    ):
        assert parser.parse_args(words).at_once is value
    with pytest.raises(ArgumentError, match="at_once"):
        parser.parse_args(["--no_at_once"])


def test_help_shows_dashes_only() -> None:
    text = make_parser().format_help()
    assert "--eval-scenes" in text
    assert "--eval_scenes" not in text
