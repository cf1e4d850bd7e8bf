"""Run agents on scenes under equal conditions and write rows, table, curves, pictures and a report.

Command: ``python -m train.evaluate --agents random,fbe,anm --scenes home:flat:1 --seeds 3``.
"""

import json
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from jsonargparse import ActionYesNo, ArgumentParser
from tqdm import tqdm

from train.backends import BACKENDS, Backend, run_on
from train.command import parse_seeds, run_command, scene_label, split_list
from train.episodes import Job, play, split_agent
from train.report import write_report
from train.results import MAP_LEFT_OUT, Row, append_row, finished_keys, read_rows, row_key
from train.tables.comparison import make_table
from train.tables.measures import agent_name
from train.tables.text import format_table, table_as_json

ROWS_FILE: Final = "rows.jsonl"
"""Name of the rows' file in the run's folder."""
DEFAULT_BACKEND: Final = Backend()
"""Two processes here."""


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
        labels = [scene_label(scene) for scene in self.scenes]
        if len(set(labels)) != len(labels):
            raise ValueError(f"`scenes` must have different names in the rows, got {', '.join(labels)}")

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
    return play_missing(evaluation.jobs(), evaluation.out, backend, play)


def play_missing(
    jobs: Sequence[Job],
    out: Path,
    backend: Backend = DEFAULT_BACKEND,
    play: Callable[[Job], Row] = play,
) -> list[Row]:
    """Play the jobs that have no row in a run's folder yet and append theirs.

    Args:
        jobs: The episodes; one whose map is to be scored is played again if that was left out.
        out: The run's folder.
        backend: Where to play.
        play: Plays one job and returns its row.

    Returns:
        The rows of exactly these jobs, in their order.
    """
    path = out / ROWS_FILE
    rows = read_rows(path)
    finished, scored = finished_keys(rows), finished_keys(row for row in rows if not row.get(MAP_LEFT_OUT))
    missing = [job for job in jobs if job.key not in (scored if job.with_maps else finished)]
    bar = tqdm(total=len(jobs), initial=len(jobs) - len(missing), unit="episode", smoothing=0.1)
    with bar:
        for job, row in run_on(backend, play, missing):
            append_row(path, row)
            bar.set_postfix_str(f"{job.name}: {_outcome(row)}")
            bar.update()
    return _rows_of(jobs, read_rows(path))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    options = _parser().parse_args(arguments)
    evaluation = Evaluation(
        agents=split_list(options.agents),
        scenes=split_list(options.scenes),
        seeds=parse_seeds(options.seeds),
        steps=options.steps,
        out=Path(options.out),
        env_options=options.env or {},
        with_maps=options.maps,
        with_pictures=options.pictures,
    )
    write_settings(evaluation)
    rows = evaluate(evaluation, backend_of(options, evaluation.out))
    table = make_table(rows)
    print(format_table(table))
    if options.json:
        Path(options.json).write_text(json.dumps(table_as_json(table), indent=2) + "\n", encoding="utf-8")
    print(f"report: {write_report(evaluation.out, rows, evaluation.out.name)}")
    report_failures(rows)


def add_backend_options(parser: ArgumentParser) -> None:
    """Let a command choose where its episodes are played."""
    add = parser.add_argument
    add("--workers", type=int, default=2, help="processes, one thread each; 0 stays in this process")
    add("--backend", choices=BACKENDS, default="loky", help="processes here, a dask cluster, or Slurm")
    add("--backend-options", type=dict | None, default=None, help="options of dask's client or of submitit")


def backend_of(options: Any, out: Path) -> Backend:
    """Read what `add_backend_options` added."""
    return Backend(options.backend, options.workers, options.backend_options or {}, out.resolve() / "slurm")


def write_settings(evaluation: Evaluation) -> None:
    """Leave the run's own settings beside its rows."""
    evaluation.out.mkdir(parents=True, exist_ok=True)
    text = json.dumps(asdict(evaluation), indent=2, default=str)
    (evaluation.out / "settings.json").write_text(text + "\n", encoding="utf-8")


def _rows_of(jobs: Iterable[Job], rows: Iterable[Row]) -> list[Row]:
    by_key = {row_key(row): row for row in rows}
    return [by_key[job.key] for job in jobs if job.key in by_key]


def report_failures(rows: Iterable[Row]) -> None:
    """Name the episodes that raised; exit code 1 if there are any."""
    failed = [row for row in rows if row.get("error")]
    for row in failed:
        name = agent_name(row["agent"], row["preset"])
        print(f"failed: {name} in {row['scene']}, seed {row['seed']}: {_outcome(row)}", file=sys.stderr)
    if failed:
        sys.exit(1)


def _outcome(row: Row) -> str:
    return row["error"].splitlines()[0] if row.get("error") else f"{row['comp_pct']:.1f} %"


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
    return parser


if __name__ == "__main__":
    run_command(main)
