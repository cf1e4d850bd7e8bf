"""Runs that go on where they stopped: play what has no row yet, on any backend, and name failures."""

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from jsonargparse import ArgumentParser
from tqdm import tqdm

from train.backends import BACKENDS, Backend, run_on
from train.episodes import FREE_PROTOCOL, Job, play
from train.provenance import check_scene_files, versions
from train.results import MAP_LEFT_OUT, Row, append_row, finished_keys, read_rows, row_key, write_json
from train.run_folder import SETTINGS_FILE, hold_folder
from train.tables.comparison import check_comparable
from train.tables.measures import agent_name

ROWS_FILE: Final = "rows.jsonl"
"""Name of the rows' file in the run's folder."""
DEFAULT_BACKEND: Final = Backend()
"""Two processes here."""


def play_missing(
    jobs: Sequence[Job],
    out: Path,
    settings: Mapping[str, Any],
    backend: Backend = DEFAULT_BACKEND,
    play: Callable[[Job], Row] = play,
) -> list[Row]:
    """Play the jobs that have no row in a run's folder yet and append theirs.

    Args:
        jobs: The episodes; one whose map is to be scored is played again if that was left out.
        out: The run's folder.
        settings: What was asked for; left beside the rows, with the versions at work.
        backend: Where to play.
        play: Plays one job and returns its row.

    Returns:
        The rows of exactly these jobs, in their order.

    Raises:
        ValueError: If rows of a scene were played in another file of that name, or before it changed, if
            no table could hold a new row beside those of its protocol (nothing of it is written then), or if
            another process plays into the folder.
    """
    hold_folder(out)
    path = out / ROWS_FILE
    rows = read_rows(path)
    for root in {job.scenes_root for job in jobs}:
        check_scene_files((job.scene for job in jobs if job.scenes_root == root), rows, path, root)
    finished, scored = finished_keys(rows), finished_keys(row for row in rows if not row.get(MAP_LEFT_OUT))
    missing = [job for job in jobs if job.key not in (scored if job.with_maps else finished)]
    kept, failed = _kept_rows(missing, rows), list[Row]()
    # The versions are those of the code as it is now: it may change while episodes are played.
    write_json(out / SETTINGS_FILE, {**settings, "versions": versions()})
    asked = {job.key for job in jobs}
    _point_out_earlier([row for row in kept if row_key(row) in asked], len(jobs))
    bar = tqdm(total=len(jobs), initial=len(jobs) - len(missing), unit="episode", smoothing=0.1)
    with bar:
        for job, row in run_on(backend, play, missing):
            _check_joins(row, kept, path)
            append_row(path, row)
            (failed if row.get("error") else kept).append(row)
            bar.set_postfix_str(f"{job.name}: {_outcome(row)}")
            bar.update()
    return _rows_of(jobs, [*read_rows(path), *failed])


def add_backend_options(parser: ArgumentParser) -> None:
    """Let a command choose where its episodes are played."""
    add = parser.add_argument
    add("--workers", type=int, default=2, help="processes, one thread each; 0 stays in this process")
    add("--backend", choices=BACKENDS, default="loky", help="processes here, a dask cluster, or Slurm")
    add("--backend-options", type=dict | None, default=None, help="options of dask's client or of submitit")


def backend_of(options: Any, out: Path) -> Backend:
    """Read what `add_backend_options` added."""
    return Backend(options.backend, options.workers, options.backend_options or {}, out.resolve() / "slurm")


def report_failures(rows: Iterable[Row]) -> None:
    """Name the episodes that raised; exit code 1 if there are any."""
    failed = [row for row in rows if row.get("error")]
    for row in failed:
        print(
            f"failed: {_player(row)} in {row['scene']}, seed {row['seed']}: {_outcome(row)}", file=sys.stderr
        )
    if failed:
        sys.exit(1)


def _player(row: Row) -> str:
    return agent_name(row["agent"], row["preset"])


def _point_out_earlier(rows: Sequence[Row], num_jobs: int) -> None:
    """Say which episodes are not played now though the code may have changed since: their numbers are old."""
    now = versions()["commit"]
    commits = {(row.get("versions") or {}).get("commit", "") for row in rows if not row.get("error")}
    if earlier := sorted(commit for commit in commits if commit != now or commit.endswith("+")):
        print(
            f"{len(rows)} of {num_jobs} episodes were played before, by the code as of "
            f"{', '.join(earlier)} (now {now}); another `--out` folder plays them anew",
            file=sys.stderr,
        )


def rows_beside(row: Row, rows: Iterable[Row]) -> list[Row]:
    """The rows that belong into one table with another.

    They are those of its protocol; where the budget is part of no protocol, those of its budget.
    """
    is_free = row["protocol"].startswith(FREE_PROTOCOL)
    same = [each for each in rows if each["protocol"] == row["protocol"]]
    return [each for each in same if each["steps"] == row["steps"]] if is_free else same


def _kept_rows(missing: Sequence[Job], rows: Iterable[Row]) -> list[Row]:
    """The rows that stay as they are; failed ones do not matter."""
    replaced = {job.key for job in missing}
    return [row for row in rows if row_key(row) not in replaced and not row.get("error")]


def _check_joins(row: Row, kept: Sequence[Row], path: Path) -> None:
    """Refuse a row that would spoil the file: no table could be made of it and those that are there."""
    try:
        check_comparable([*rows_beside(row, kept), row])
    except ValueError as error:
        raise ValueError(
            f"{_player(row)} in {row['scene']} cannot join {path}, as settings, weights, the scene or "
            f"this code have changed since: {error}"
        ) from error


def _rows_of(jobs: Iterable[Job], rows: Iterable[Row]) -> list[Row]:
    by_key = {row_key(row): row for row in rows}
    return [by_key[job.key] for job in jobs if job.key in by_key]


def _outcome(row: Row) -> str:
    return row["error"].splitlines()[0] if row.get("error") else f"{row['comp_pct']:.1f} %"
