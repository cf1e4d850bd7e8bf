"""Runs that go on where they stopped: play what has no row yet, on any backend, and name failures."""

import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Final

from jsonargparse import ArgumentParser
from tqdm import tqdm

from train.backends import BACKENDS, Backend, run_on
from train.episodes import Job, play
from train.provenance import check_scene_files
from train.results import MAP_LEFT_OUT, Row, append_row, finished_keys, read_rows, row_key
from train.tables.measures import agent_name

ROWS_FILE: Final = "rows.jsonl"
"""Name of the rows' file in the run's folder."""
DEFAULT_BACKEND: Final = Backend()
"""Two processes here."""


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

    Raises:
        ValueError: If rows of a scene were played in another file of that name, or before it changed, or if
            those of an agent were played with other settings.
    """
    path = out / ROWS_FILE
    rows = read_rows(path)
    for root in {job.scenes_root for job in jobs}:
        check_scene_files((job.scene for job in jobs if job.scenes_root == root), rows, path, root)
    finished, scored = finished_keys(rows), finished_keys(row for row in rows if not row.get(MAP_LEFT_OUT))
    missing = [job for job in jobs if job.key not in (scored if job.with_maps else finished)]
    kept = {job.key for job in jobs} - {job.key for job in missing}
    settings = {_player(row): row.get("settings_hash") for row in rows if row_key(row) in kept}
    failed: list[Row] = []
    bar = tqdm(total=len(jobs), initial=len(jobs) - len(missing), unit="episode", smoothing=0.1)
    with bar:
        for job, row in run_on(backend, play, missing):
            _check_settings(row, settings.get(_player(row)), path)
            append_row(path, row)
            if row.get("error"):
                failed.append(row)
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


def _check_settings(row: Row, kept: str | None, path: Path) -> None:
    """Refuse to add a row to those of an agent with other settings: no table could be made of both."""
    played = row.get("settings_hash")
    if kept is not None and played is not None and played != kept:
        raise ValueError(
            f"the rows of {_player(row)} in {path} must come from its settings as they are now, {played}, "
            f"got {kept}; its defaults or its weights have changed: write to another `--out` folder"
        )


def _rows_of(jobs: Iterable[Job], rows: Iterable[Row]) -> list[Row]:
    by_key = {row_key(row): row for row in rows}
    return [by_key[job.key] for job in jobs if job.key in by_key]


def _outcome(row: Row) -> str:
    return row["error"].splitlines()[0] if row.get("error") else f"{row['comp_pct']:.1f} %"
