"""Run agents on scenes under equal conditions and write rows, table, curves, pictures and a report.

Command: ``python -m train.evaluate --agents random,fbe,anm --scenes home:flat:1 --seeds 3``.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from jsonargparse import ActionYesNo, ArgumentParser

from train.backends import Backend
from train.command import check_scene_names, parse_seeds, run_command, split_list
from train.episodes import Job, play, split_agent
from train.play import (
    DEFAULT_BACKEND,
    ROWS_FILE,
    add_backend_options,
    backend_of,
    play_missing,
    report_failures,
    rows_beside,
)
from train.quick import STEPS, add_quick_option, env_options, parse_quick
from train.report import write_report
from train.results import Row, read_rows, write_json
from train.tables.comparison import make_table
from train.tables.text import format_table, table_as_json


@dataclass(frozen=True)
class Evaluation:
    """What to run and where to write it."""

    agents: Sequence[str]
    """Agents of the roster, such as `fbe` or `anm:paper`."""
    scenes: Sequence[str]
    """Paths of meshes or floor plans, or procedural names."""
    seeds: Sequence[int] = (0, 1, 2)
    """One episode per agent, scene and seed; the seed draws the start."""
    steps: int = 1000
    """Budget of an episode."""
    out: Path = Path("runs/evaluation")
    """Folder of the rows and the report."""
    env_options: dict[str, Any] = field(default_factory=dict)
    """Arguments of the environment besides the scene."""
    with_maps: bool = True
    """Whether to score neural maps."""
    with_pictures: bool = True
    """Whether to draw every episode."""

    def __post_init__(self) -> None:
        if not self.agents or not self.scenes or not self.seeds:
            raise ValueError("`agents`, `scenes` and `seeds` must each name at least one")
        if self.steps < 1:
            raise ValueError(f"`steps` must be >= 1, got {self.steps}")
        if len(set(map(split_agent, self.agents))) != len(self.agents):
            raise ValueError(f"`agents` must differ, got {', '.join(self.agents)}")
        if len(set(self.seeds)) != len(self.seeds):
            raise ValueError(f"`seeds` must differ, got {', '.join(map(str, self.seeds))}")
        check_scene_names(self.scenes)

    def jobs(self) -> list[Job]:
        """List the episodes, scene by scene, so that a worker keeps a scene it has loaded."""
        return [
            Job(
                *split_agent(agent),
                scene,
                seed,
                self.steps,
                self.out.resolve(),
                self.env_options,
                self.with_maps,
                self.with_pictures,
            )
            for scene in self.scenes
            for seed in self.seeds
            for agent in self.agents
        ]


def evaluate(
    evaluation: Evaluation, backend: Backend = DEFAULT_BACKEND, play: Callable[[Job], Row] = play
) -> list[Row]:
    """Run the episodes that have no row yet and append theirs.

    Args:
        evaluation: What to run.
        backend: Where to play.
        play: Plays one job and returns its row.

    Returns:
        The rows of exactly the episodes asked for, in their order.
    """
    return play_missing(evaluation.jobs(), evaluation.out, asdict(evaluation), backend, play)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    options = parse_quick(
        _parser(),
        arguments,
        scenes=["home:studio:1"],
        seeds=["2"],
        steps=STEPS,
        maps=False,
        out="runs/evaluation-quick",
    )
    evaluation = Evaluation(
        agents=split_list(options.agents),
        scenes=split_list(options.scenes),
        seeds=parse_seeds(options.seeds),
        steps=options.steps,
        out=Path(options.out),
        env_options=env_options(options),
        with_maps=options.maps,
        with_pictures=options.pictures,
    )
    rows = evaluate(evaluation, backend_of(options, evaluation.out))
    table = make_table(rows)
    print(format_table(table))
    if options.json:
        write_json(Path(options.json), table_as_json(table))
    whole = rows_beside(rows[0], read_rows(evaluation.out / ROWS_FILE))
    print(f"report: {write_report(evaluation.out, whole, evaluation.out.name)}")
    report_failures(rows)


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="python -m train.evaluate", description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("--config", action="config", help="YAML file with any of these options")
    add("--agents", nargs="+", default=["random", "fbe", "anm"], help="agents, such as fbe or anm:paper")
    add("--scenes", nargs="+", default=["home:flat:1"], help="meshes, floor plans or procedural names")
    add("--seeds", nargs="+", default=["3"], help="a count, or the seeds themselves: 0,1,2")
    add("--steps", type=int, default=1000, help="budget of an episode")
    add_backend_options(parser)
    add("--out", default="runs/evaluation", help="folder of the run; started again, it goes on")
    add("--env", type=dict | None, default=None, help="arguments of the environment, such as a camera")
    add("--maps", action=ActionYesNo(yes_prefix="", no_prefix="no-"), default=True, help="score neural maps")
    add("--pictures", action=ActionYesNo(yes_prefix="", no_prefix="no-"), default=True, help="draw episodes")
    add("--json", default=None, help="write the printed table to this file")
    add_quick_option(parser, f"a small home, two seeds, {STEPS} steps, maps without a score")
    return parser


if __name__ == "__main__":
    run_command(main)
