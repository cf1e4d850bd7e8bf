"""Where episodes are played: worker processes here, a dask cluster, or Slurm; chosen by one option.

Every job is a pure function of its fields and every row is written by the process that asked, so that an
interrupted run goes on wherever it is started again. Local processes are in `train.pool`.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any, Final, TypeVar

from anm_gym.checks import check_known
from anm_gym.errors import BackendError
from anm_gym.scenes.datasets import ROOT_VARIABLE
from train.pool import prepare_worker, run_jobs

JobT = TypeVar("JobT")
ResultT = TypeVar("ResultT")

_GOES_ON: Final = "the same command plays what is missing"
BACKENDS: Final = ("loky", "dask", "slurm")
"""Processes of joblib's own pool, a dask cluster through joblib, Slurm arrays through submitit."""


@dataclass(frozen=True)
class Backend:
    """Where to play, and how widely.

    Raises:
        ValueError: If there is no such backend, or the local one is given options.
    """

    name: str = "loky"
    """One of `BACKENDS`."""
    workers: int = 2
    """Processes, or Slurm tasks, at a time; 0 stays in this process, whatever the backend."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """For dask those of `distributed.Client`, such as the `address` of a scheduler; without one, and without
    $DASK_SCHEDULER_ADDRESS, processes start here. For Slurm those of submitit, such as `slurm_partition`."""
    folder: Path = Path("runs/slurm")
    """Where Slurm's tasks find their jobs and leave their logs; on a file system that all nodes share."""

    def __post_init__(self) -> None:
        check_known("backend", self.name, BACKENDS)
        if self.name == "loky" and self.options:
            raise ValueError(f"`options` must be empty for the backend loky, got {', '.join(self.options)}")


def run_on(
    backend: Backend, play: Callable[[JobT], ResultT], jobs: Iterable[JobT]
) -> Iterator[tuple[JobT, ResultT]]:
    """Play jobs on a backend and hand each result over as it comes, in no fixed order.

    Args:
        backend: Where.
        play: Called with one job in a worker.
        jobs: The jobs, started in order.

    Yields:
        A job and its result.

    Raises:
        BackendError: If the backend's package is missing, its cluster cannot be reached, or it lost jobs; on
            Slurm, after all others have been handed over.
        ValueError: If dask has no option of a given name.
        RuntimeError: If a local worker process was killed from outside.
    """
    listed = list(jobs)
    if backend.name == "loky" or backend.workers == 0 or not listed:
        yield from run_jobs(play, listed, backend.workers)
    else:
        yield from {"dask": _run_on_dask, "slurm": _run_on_slurm}[backend.name](backend, play, listed)


def _run_on_dask(
    backend: Backend, play: Callable[[JobT], ResultT], jobs: list[JobT]
) -> Iterator[tuple[JobT, ResultT]]:
    try:
        import distributed
    except ImportError as error:
        raise BackendError(_advice("dask", error)) from error
    from joblib import Parallel, delayed, parallel_config

    _check_dask_options(distributed, backend.options)
    with _dask_client(distributed, backend) as client:
        threads = list(client.nthreads().values())
        if len(threads) < 2:  # joblib would play in this process
            raise BackendError(f"the dask cluster must have at least 2 workers, got {len(threads)}")
        if max(threads) > 1:  # episodes in one process would be charged each other's CPU time
            raise BackendError(
                f"each worker of the dask cluster must have one thread, got {max(threads)}; "
                "start `dask worker` with --nthreads 1, and more of them"
            )
        with parallel_config(backend="dask"):  # left before the first result: joblib's default stays
            pool = Parallel(n_jobs=-1, return_as="generator_unordered", batch_size=1)
        try:
            yield from pool(delayed(_play_one)(play, _scene_root(), job) for job in jobs)
        except distributed.KilledWorker as error:
            raise BackendError(f"dask gave an episode up: {error}; {_GOES_ON}") from error


def _check_dask_options(distributed: Any, options: Mapping[str, Any]) -> None:
    """Refuse names that dask would hand on to its workers, where each would end in a traceback."""
    takers = (distributed.Client, distributed.LocalCluster, distributed.Nanny, distributed.Worker)
    known = {name for taker in (*takers, distributed.core.Server) for name in signature(taker).parameters}
    if unknown := sorted(set(options) - known):
        raise ValueError(
            "`options` must be those of distributed.Client, LocalCluster or Worker, "
            f"got {', '.join(unknown)}; leave out or mend"
        )


def _dask_client(distributed: Any, backend: Backend) -> Any:
    """Connect to the scheduler that the options or the variable name, or start processes here."""
    import dask

    address = backend.options.get("address") or dask.config.get("scheduler-address", None)
    chosen = dict(backend.options)
    if address is None:
        chosen = {"n_workers": backend.workers, "threads_per_worker": 1, "dashboard_address": None} | chosen
    try:
        return distributed.Client(**chosen)
    except (OSError, TimeoutError) as error:
        raise BackendError(f"no dask scheduler answers at {address}: {error}; start one there") from error


def _run_on_slurm(
    backend: Backend, play: Callable[[JobT], ResultT], jobs: list[JobT]
) -> Iterator[tuple[JobT, ResultT]]:
    try:
        import submitit
    except ImportError as error:
        raise BackendError(_advice("slurm", error)) from error
    options = {"cpus_per_task": 1, "slurm_array_parallelism": backend.workers, **backend.options}
    cluster = options.pop("cluster", "slurm")
    try:
        executor = submitit.AutoExecutor(folder=backend.folder, cluster=cluster)
    except RuntimeError as error:
        raise BackendError(
            f"Slurm must be at hand, got none: {error}; log in to a node that has it"
        ) from error
    executor.update_parameters(**options)
    tasks = executor.map_array(partial(_play_one, play, _scene_root()), jobs)
    lost: list[str] = []
    try:
        for task in submitit.helpers.as_completed(tasks, poll_frequency=0.5 if cluster != "slurm" else 10):
            try:
                result = task.result()
            except RuntimeError as error:  # submitit's, of a task that ended without a result
                lost.append(str(error))
                continue
            yield result
    finally:
        for task in tasks:
            if not task.done():
                task.cancel()
    if lost:
        raise BackendError(
            f"{len(lost)} of {len(tasks)} tasks ended without a result, the first with: {lost[0]}; {_GOES_ON}"
        )


def _play_one(play: Callable[[JobT], ResultT], scene_root: str | None, job: JobT) -> tuple[JobT, ResultT]:
    prepare_worker()
    if scene_root is not None:
        os.environ[ROOT_VARIABLE] = scene_root
    return job, play(job)


def _scene_root() -> str | None:
    """Where datasets lie, for workers that were started with another environment."""
    return os.environ.get(ROOT_VARIABLE)


def _advice(name: str, error: ImportError) -> str:
    return f"the backend {name} needs {error.name}; pip install 'anm-gym[cluster]'"
