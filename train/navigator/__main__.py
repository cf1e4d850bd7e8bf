"""Train a point-goal navigator on generated homes, or compare navigators: `python -m train.navigator`."""

from collections.abc import Sequence
from pathlib import Path

import torch
from jsonargparse import ActionYesNo, ArgumentParser

from train.command import run_command, split_list
from train.navigator.presets import PRESETS, VARIANTS, training_of
from train.navigator.ranks import Ranks
from train.navigator.run import NavigatorRun
from train.navigator.table import NavigationComparison, compare_navigators


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    options = _parser().parse_args(arguments)
    if options.evaluate:
        compare_navigators(
            NavigationComparison(
                navigators=split_list(options.navigators),
                scenes=split_list(options.scenes),
                episodes=8 if options.quick else options.episodes,
                step_m=options.step_m,
                deterministic=options.argmax,
                workers=options.workers,
                out=Path(options.out),
            ),
            json_path=options.json and Path(options.json),
        )
        return
    training = training_of(
        "quick" if options.quick else options.preset,
        options.variant,
        imitation_frames=options.imitation_frames,
        reinforcement_frames=options.reinforcement_frames,
        num_agents=options.agents,
        seed=options.seed,
    )
    ranks = Ranks.join()
    torch.set_num_threads(1)
    try:
        run = NavigatorRun(training, Path(options.out), ranks)
        run.train()
        if ranks.is_first:
            print(f"weights: {run.folder / 'policy.safetensors'}")
    finally:
        ranks.leave()


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="python -m train.navigator", description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("--config", action="config", help="YAML file with any of these options")
    add("--preset", default="mini", help=f"network and budget: {', '.join(PRESETS)}")
    add("--variant", default="plus", help=f"homes to train on: {', '.join(VARIANTS)}")
    add("--imitation-frames", type=int | None, default=None, help="budget of the first stage")
    add("--reinforcement-frames", type=int | None, default=None, help="budget of the second stage")
    add("--agents", type=int | None, default=None, help="agents of each process")
    add("--seed", type=int, default=0, help="seeds everything")
    add("--out", default="runs/navigator", help="folder of the run; started again, it goes on")
    add("--quick", action=ActionYesNo(yes_prefix="", no_prefix="no-"), default=False, help="a minute's worth")
    add(
        "--evaluate",
        action=ActionYesNo(yes_prefix="", no_prefix="no-"),
        default=False,
        help="compare instead",
    )
    add("--navigators", nargs="+", default=["ddppo", "planner", "oracle"], help="navigators, or files")
    add("--scenes", nargs="+", default=["home:flat:1"], help="meshes, floor plans or procedural names")
    add("--episodes", type=int, default=100, help="episodes of every navigator, spread over the scenes")
    add("--step-m", type=float, default=0.065, help="length of a forward step, metres")
    add(
        "--argmax",
        action=ActionYesNo(yes_prefix="", no_prefix="no-"),
        default=False,
        help="likeliest actions",
    )
    add("--workers", type=int, default=2, help="processes of a comparison; 0 stays in this one")
    add("--json", default=None, help="write the printed table to this file")
    return parser


if __name__ == "__main__":
    run_command(main)
