"""Train a point-goal navigator on generated homes, or compare navigators: `python -m train.navigator`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import torch
from jsonargparse import ActionYesNo, ArgumentParser

from train.command import run_command, split_list
from train.navigator.hardware import Hardware
from train.navigator.presets import PRESETS, VARIANTS, NavigatorTraining, training_of
from train.navigator.ranks import Ranks
from train.navigator.run import NavigatorRun
from train.navigator.table import NavigationComparison, compare_navigators
from train.option_names import spell_with_dashes

CHANGES: Final = ("net", "domain", "imitation", "reinforcement", "evaluation_every", "evaluation_episodes")
"""Options that change fields of the preset."""
TRAINING: Final = frozenset(
    {"preset", "variant", "imitation_frames", "reinforcement_frames", "agents", "seed", "device", "backend"}
    | {*CHANGES}
)
"""Options that a comparison does not have."""
COMPARISON: Final = frozenset(
    {"navigators", "scenes", "episodes", "step_m", "argmax", "scene_options", "workers", "json"}
)
"""Options that training does not have."""
QUICK_EPISODES: Final = 8
"""Episodes of every navigator in a quick comparison, if there are no more scenes."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    options, given = read_options(arguments)
    if options["evaluate"]:
        compare_navigators(_comparison(options, given), json_path=options["json"] and Path(options["json"]))
        return
    training = training_from(options, given)
    hardware = Hardware(options["device"], options["backend"]).of_process()
    ranks = Ranks.join()
    torch.set_num_threads(1)
    try:
        run = NavigatorRun(training, Path(options["out"]), ranks, hardware)
        run.train()
        if ranks.is_first:
            print(f"weights: {run.folder / 'policy.safetensors'}")
    finally:
        ranks.leave()


def read_options(arguments: Sequence[str] | None = None) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read command line and YAML file; options that would do nothing end the command, exit code 2.

    Args:
        arguments: Words of the command line; None for those of the process.

    Returns:
        All options, and those that were given.
    """
    parser = _parser()
    options = parser.parse_args(arguments).as_dict()
    given = parser.parse_args(arguments, defaults=False).as_dict()
    other = TRAINING if options["evaluate"] else COMPARISON
    useless = ", ".join(f"--{name.replace('_', '-')}" for name in given if name in other)
    if useless and options["evaluate"]:
        parser.error(f"--evaluate must come without options of training, got {useless}; leave them out")
    if useless:
        parser.error(f"training must come without options of a comparison, got {useless}; add --evaluate")
    if options["quick"] and given.get("preset", "quick") != "quick":
        parser.error(f"--quick must not come with another preset, got --preset {given['preset']}")
    if options["quick"] and "out" not in given:
        options["out"] += "-quick"
    return options, given


def training_from(options: dict[str, Any], given: dict[str, Any]) -> NavigatorTraining:
    """Settings of a training run: the preset's, changed by what was given.

    Args:
        options: All options.
        given: Those that were given.
    """
    return training_of(
        "quick" if options["quick"] else options["preset"],
        options["variant"],
        {name: given[name] for name in CHANGES if name in given},
        imitation_frames=options["imitation_frames"],
        reinforcement_frames=options["reinforcement_frames"],
        num_agents=options["agents"],
        seed=options["seed"],
    )


def _comparison(options: dict[str, Any], given: dict[str, Any]) -> NavigationComparison:
    navigators, scenes = split_list(options["navigators"]), split_list(options["scenes"])
    for name, names in (("navigators", navigators), ("scenes", scenes)):
        if not names:
            raise ValueError(f"`{name}` must name at least one, got none")
    is_short = options["quick"] and "episodes" not in given
    return NavigationComparison(
        navigators=navigators,
        scenes=scenes,
        episodes=max(QUICK_EPISODES, len(scenes)) if is_short else options["episodes"],
        step_m=options["step_m"],
        deterministic=options["argmax"],
        scene_options=options["scene_options"] or {},
        workers=options["workers"],
        out=Path(options["out"]),
    )


def _parser() -> ArgumentParser:
    parser = ArgumentParser(
        prog="python -m train.navigator",
        usage="python -m train.navigator [options], or with --evaluate",
        description=__doc__.splitlines()[0],
    )
    add, flag = parser.add_argument, ActionYesNo(yes_prefix="", no_prefix="no-")
    add("--config", action="config", help="YAML file with any of these options, underscores for dashes")
    add("--out", default="runs/navigator", help="folder of the run; started again, it goes on")
    add("--quick", action=flag, default=False, help="a minute's worth: the preset quick, or few episodes")
    add("--evaluate", action=flag, default=False, help="compare navigators instead of training one")
    _add_comparison(parser)
    _add_training(parser)
    return spell_with_dashes(parser)


def _add_comparison(parser: ArgumentParser) -> None:
    group = parser.add_argument_group("comparison, with --evaluate")
    add, flag = group.add_argument, ActionYesNo(yes_prefix="", no_prefix="no-")
    add("--navigators", nargs="+", default=["ddppo", "planner", "oracle"], help="navigators, or files")
    add("--scenes", nargs="+", default=["home:flat:1"], help="meshes, floor plans or procedural names")
    add("--episodes", type=int, default=100, help="episodes of every navigator, spread over the scenes")
    add("--step-m", type=float, default=0.065, help="length of a forward step, metres")
    add("--argmax", action=flag, default=False, help="likeliest actions")
    add("--scene-options", type=dict | None, default=None, help="keywords for mesh files, such as unit")
    add("--workers", type=int, default=2, help="processes of a comparison; 0 stays in this one")
    add("--json", default=None, help="write the printed table to this file")


def _add_training(parser: ArgumentParser) -> None:
    add = parser.add_argument_group("training").add_argument
    add("--preset", default="mini", help=f"network and budget: {', '.join(PRESETS)}")
    add("--variant", default="plus", help=f"homes to train on: {', '.join(VARIANTS)}")
    add("--imitation-frames", type=int | None, default=None, help="budget of the first stage")
    add(
        "--reinforcement-frames",
        type=int | None,
        default=None,
        help="budget of the second stage: 0, or a rollout more than --reinforcement.value-frames",
    )
    add("--agents", type=int | None, default=None, help="agents of each process")
    add("--seed", type=int, default=0, help="seeds everything")
    add("--device", default="cpu", help="where the networks learn: cpu, cuda or cuda:1")
    add("--backend", default="embree", help="what draws depth in training: embree, or warp on the device")
    # What is shown as a default below is that of the preset mini; only what is given changes the preset.
    parser.add_class_arguments(NavigatorTraining, skip={"num_agents", "seed"})


if __name__ == "__main__":
    run_command(main)
