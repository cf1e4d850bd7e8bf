"""Make a table of the paper by one command.

Command: ``python -m train.tables table1 --protocol open-homes``. The arithmetic is in
`train.tables.comparison`, the lines and columns in `train.tables.rosters`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from pathlib import Path
from typing import Any, Final

from jsonargparse import ActionYesNo, ArgumentParser

from agents.roster import ROSTER
from anm_gym.scenes.datasets import ROOT_VARIABLE
from train import quick
from train.command import parse_seeds, run_command, split_list
from train.episodes import split_agent
from train.play import ROWS_FILE, add_backend_options, backend_of, report_failures, rows_beside
from train.protocols import PROTOCOLS, Protocol, open_protocol
from train.provenance import environment_digest
from train.report import write_report
from train.results import Row, read_rows, write_json
from train.tables.measures import agent_name
from train.tables.result import format_result, make_result, result_as_json
from train.tables.rosters import TABLES
from train.tables.run import QUICK_SEEDS, QUICK_STEPS, TableRun, play_table

DEFAULT_SEEDS: Final = 5
"""Starts per scene: a single one tells nothing of what luck does."""
DEFAULT_PROTOCOL: Final = "open-homes"
"""Protocol of a table where none is named."""
_ONLY_PLAYED: Final = ("protocol", "root", "out", "env", "quick")
"""Options that say how to play, and so mean nothing for rows that are there."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    options = _parser().parse_args(arguments)
    if options.rows is not None:
        print_rows(options)
        return
    played = play_options(options)
    result = make_result(options.table, options.preset, played.rows, played.reference)
    print(format_result(result))
    if options.json is not None:
        write_json(Path(options.json), result_as_json(result))
    print(f"report: {describe_folder(options.table, options.preset, played)}")
    report_failures(played.rows)


def describe_folder(table: str, preset: str, played: "Played") -> Path:
    """Write table and report of all that a run's folder holds, even if fewer agents or starts were asked for.

    Returns:
        Path of the report.
    """
    out = played.run.out
    rows = rows_beside(played.rows[0], read_rows(out / ROWS_FILE))
    write_json(out / f"{table}.json", result_as_json(make_result(table, preset, rows, played.reference)))
    return write_report(out, rows, f"{TABLES[table].title}, {played.run.protocol.name}")


def print_rows(options: Any) -> None:
    """Print the table of rows that are there; nothing is played, and nothing written but `--json`.

    Raises:
        ValueError: If an option asks for anything else, or for an agent, a scene or a seed without a row.
    """
    if others := [name for name in _ONLY_PLAYED if getattr(options, name)]:
        raise ValueError(
            f"`rows` prints what was played: leave out {', '.join(f'--{name}' for name in others)}"
        )
    path = Path(options.rows)
    path = path / ROWS_FILE if path.is_dir() else path
    rows = _asked_rows(read_rows(path), options, path)
    agents = list(dict.fromkeys(agent_name(row["agent"], row["preset"]) for row in rows))
    result = make_result(options.table, options.preset, rows, _reference_of(options, agents))
    print(format_result(result))
    if options.json is not None:
        write_json(Path(options.json), result_as_json(result))


def _asked_rows(rows: Sequence[Row], options: Any, path: Path) -> list[Row]:
    """The rows of the agents, scenes, seeds and budget that the options name, or of all; see `print_rows`."""
    asked: list[tuple[str, Sequence[Any], Callable[[Row], Any]]] = [
        (
            "agents",
            [agent_name(*split_agent(agent)) for agent in split_list(options.agents or [])],
            lambda row: agent_name(row["agent"], row["preset"]),
        ),
        ("scenes", split_list(options.scenes or []), itemgetter("scene")),
        ("seeds", parse_seeds(options.seeds) if options.seeds else [], itemgetter("seed")),
        ("steps", [] if options.steps is None else [options.steps], itemgetter("steps")),
    ]
    for option, wanted, value in asked:
        if wanted:
            rows = [row for row in rows if value(row) in wanted]
        if missing := set(wanted) - set(map(value, rows)):
            names = ", ".join(sorted(map(str, missing)))
            raise ValueError(f"`{option}` must name what has rows, got {names}, which has none in {path}")
    if not rows:
        raise ValueError(f"`rows` must be a folder with rows of what is asked for, got none in {path}")
    return list(rows)


@dataclass(frozen=True, eq=False)
class Played:
    """What a command line asked for."""

    run: TableRun
    """What was to be played."""
    rows: Sequence[Row]
    """Its rows."""
    reference: str
    """Whom to compare with."""


def play_command(arguments: Sequence[str]) -> Played:
    """Play what a command line asks for and has no row yet; see `play_options`."""
    return play_options(_parser().parse_args(arguments))


def play_options(options: Any) -> Played:
    """Play what the options ask for and has no row yet.

    Raises:
        ValueError: If an agent, its preset or a variant is unknown; nothing is played then.
    """
    spec = TABLES[options.table]
    if options.preset not in ROSTER["anm"].presets:
        choices = ", ".join(ROSTER["anm"].presets)
        raise ValueError(f"`preset` must be one of anm's, {choices}, got {options.preset!r}")
    agents = split_list(options.agents) if options.agents else spec.agents(options.preset)
    run = _run_of(options, agents)
    reference = _reference_of(options, agents)
    rows = play_table(run, backend_of(options, run.out))
    return Played(run, rows, reference)


def _reference_of(options: Any, agents: Sequence[str]) -> str:
    """Whom to compare with."""
    if not options.reference:
        return TABLES[options.table].reference.format(preset=options.preset)
    reference = agent_name(*split_agent(options.reference))
    if reference not in {agent_name(*split_agent(agent)) for agent in agents}:
        raise ValueError(f"`reference` must be one of {', '.join(agents)}, got {options.reference!r}")
    return reference


def _run_of(options: Any, agents: Sequence[str]) -> TableRun:
    """Read what to play."""
    protocol = _protocol_of(options)
    seeds = parse_seeds(options.seeds or str(DEFAULT_SEEDS))
    if options.quick and not options.seeds:
        seeds = list(QUICK_SEEDS[options.table])
    return TableRun(
        agents,
        protocol,
        seeds,
        Path(options.out) if options.out else _folder_of(options, protocol),
        quick.env_options(options),
        options.pictures,
        with_maps=not options.quick or "mad_cm" in TABLES[options.table].native,
    )


def _folder_of(options: Any, protocol: Protocol) -> Path:
    """Another budget, or environment, has a folder of its own: its rows cannot be compared with these."""
    name = protocol.base if options.quick and options.steps is None else protocol.name
    parts = name, environment_digest(options.env or {}), "quick" if options.quick else ""
    return Path("runs", options.table, "-".join(part for part in parts if part))


def _protocol_of(options: Any) -> Protocol:
    protocol = open_protocol(options.protocol or DEFAULT_PROTOCOL, options.root)
    if options.scenes:
        protocol = protocol.only(split_list(options.scenes))
    elif options.quick:
        protocol = replace(protocol, scenes=protocol.scenes[:1])
    steps = QUICK_STEPS[options.table] if options.quick and options.steps is None else options.steps
    return protocol if steps is None else protocol.shortened(steps)


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="python -m train.tables", description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("table", choices=list(TABLES), help="which table of the paper")
    add("--config", action="config", help="YAML file with any of these options")
    add(
        "--protocol",
        choices=PROTOCOLS,
        default=None,
        help=f"scenes, budgets and starts; {DEFAULT_PROTOCOL} by default",
    )
    add(
        "--root", default=None, help=f"folder of datasets (${ROOT_VARIABLE}), or of the meshes of open-scenes"
    )
    add("--scenes", nargs="+", default=None, help="only these scenes of the protocol")
    add("--agents", nargs="+", default=None, help="these agents instead of the table's")
    add("--preset", default="best", help="preset of anm: best, fast, paper or released")
    add(
        "--seeds",
        nargs="+",
        default=None,
        help=f"a count ({DEFAULT_SEEDS} by default), or the seeds themselves: 0,1,2",
    )
    add(
        "--steps",
        type=int | None,
        default=None,
        help="another budget for every scene; the protocol's name tells",
    )
    add("--reference", default=None, help="whom to compare with start by start; anm by default")
    add(
        "--out", default=None, help="folder of the run, runs/<table>/<protocol> by default; it can be resumed"
    )
    add("--env", type=dict | None, default=None, help="arguments of the environment, such as a camera")
    add("--pictures", action=ActionYesNo(yes_prefix="", no_prefix="no-"), default=True, help="draw episodes")
    add("--rows", default=None, help="print the table of the rows in this folder; nothing is played")
    add("--json", default=None, help="write the table to this file too")
    add("--quick", action="store_true", help="one scene, a few steps, a seed or two")
    add_backend_options(parser)
    return parser


if __name__ == "__main__":
    run_command(main)
