"""Teach an explorer by reinforcement: what is newly seen of generated homes is its reward.

Command: ``python -m train.coverage --out runs/coverage``.
"""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from jsonargparse import ArgumentParser

from train.command import run_command
from train.coverage.run import CoverageRun, score_baseline
from train.coverage.settings import CoverageTraining
from train.learning_curve import learning_curve_figure
from train.option_names import spell_with_dashes
from train.provenance import versions
from train.quick import add_quick_option, parse_quick
from train.results import write_json

QUICK: Final = {
    "out": Path("runs/coverage-quick"),
    "eval_scenes": ("home:studio:900-902",),
    "steps": 4000,
    "episode_steps": 50,
    "learner.num_envs": 4,
    "learner.rollout_steps": 50,
    "learner.batch_size": 50,
}
"""Defaults of `--quick`."""


def train_explorer(training: CoverageTraining) -> dict[str, Any]:
    """Train, compare with the baselines and draw the curve.

    Args:
        training: What to do, and the folder that checkpoint, log and figure go to.

    Returns:
        The curve and the baselines, shares of the floor in per cent, and the CPU time, seconds.
    """
    run = CoverageRun(training)
    curve = run.train()
    baselines_pct = {
        name: round(100.0 * float(np.mean(score_baseline(training, name))), 3) for name in training.baselines
    }
    steps = [point["steps"] for point in curve]
    seen_pct = [100.0 * np.array(point["coverages"]) for point in curve]
    result = {
        "curve": [
            {"steps": count, "coverage_pct": _mean(values), "reward": _mean(point["rewards"])}
            for count, values, point in zip(steps, seen_pct, curve, strict=True)
        ],
        "baselines_pct": baselines_pct,
        "cpu_s": round(run.progress.cpu_s, 1),
        "versions": versions(),
    }
    label = "floor seen in unseen homes (%), mean and 95 % CI"
    figure = learning_curve_figure(steps, seen_pct, baselines_pct, label, training.out / "curve.png")
    write_json(training.out / "curve.json", result)
    return result | {"figure": str(figure)}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command and print the curve."""
    options = read_options(arguments)
    torch.set_num_threads(1)
    result = train_explorer(training_of(options))
    print(f"{'steps':>10}{'floor seen (%)':>16}{'reward':>9}")
    for point in result["curve"]:
        print(f"{point['steps']:>10}{point['coverage_pct']:>16.1f}{point['reward']:>9.2f}")
    for name, value_pct in result["baselines_pct"].items():
        print(f"{name:>10}{value_pct:>16.1f}")
    print(f"{result['cpu_s']:.0f} CPU seconds; curve: {result['figure']}")
    if options.json:
        write_json(Path(options.json), result)


def read_options(arguments: Sequence[str] | None = None) -> Any:
    """Read the command line."""
    return parse_quick(_parser(), arguments, **QUICK)


def training_of(options: Any) -> CoverageTraining:
    """Settings of a run from the options of its command line."""
    values = options.as_dict()
    return CoverageTraining.from_plain({field.name: values[field.name] for field in fields(CoverageTraining)})


def _mean(values: Any) -> float:
    return round(float(np.mean(values)), 3)


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="python -m train.coverage", description=__doc__.splitlines()[0])
    parser.add_argument("--config", action="config", help="YAML file with any of these options")
    parser.add_class_arguments(CoverageTraining)
    add_quick_option(parser, "less than a minute's worth: few homes, short episodes, two rounds")
    parser.add_argument("--json", default=None, help="write curve and baselines to this file")
    return spell_with_dashes(parser)


if __name__ == "__main__":
    run_command(main)
