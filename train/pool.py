"""Worker processes for episodes: fresh interpreters on one thread each, so that no row depends on them."""

from collections.abc import Callable, Iterable, Iterator
from typing import Final, TypeVar

JobT = TypeVar("JobT")
ResultT = TypeVar("ResultT")

ONE_THREAD: Final = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of a worker: read by the numerical libraries when they are first imported."""

IDLE_TIMEOUT_S: Final = 20
"""A worker whose parent was killed ends by itself after so long without work."""


class WorkerError(RuntimeError):
    """A worker process ended before its work did."""


def prepare_worker() -> None:
    """Hold torch to one thread, for repeatable rows and comparable times, and take note of the code at work.

    Subnormal numbers are flushed by the map itself, where it learns: a flag for the whole process makes
    scipy's k-d tree recurse without end.
    """
    import torch

    from train.provenance import versions

    torch.set_num_threads(1)
    versions()


def run_jobs(
    play: Callable[[JobT], ResultT], jobs: Iterable[JobT], workers: int
) -> Iterator[tuple[JobT, ResultT]]:
    """Play jobs side by side and hand each result over as it comes, in no fixed order.

    Args:
        play: Called with one job in a worker.
        jobs: The jobs, started in order.
        workers: Number of processes; 0 plays in this process (for a debugger).

    Yields:
        A job and its result.

    Raises:
        ValueError: If `workers` is negative.
        WorkerError: If a worker process was killed from outside.
    """
    if workers < 0:
        raise ValueError(f"`workers` must be >= 0, got {workers}")
    if workers == 0:
        prepare_worker()
        for job in jobs:
            yield job, play(job)
        return
    yield from _run_in_processes(play, list(jobs), workers)


def _run_in_processes(
    play: Callable[[JobT], ResultT], jobs: list[JobT], workers: int
) -> Iterator[tuple[JobT, ResultT]]:
    from joblib.externals.loky import BrokenProcessPool, ProcessPoolExecutor, as_completed

    executor = ProcessPoolExecutor(
        max_workers=max(1, min(workers, len(jobs))),
        timeout=IDLE_TIMEOUT_S,
        initializer=prepare_worker,
        env=ONE_THREAD,
    )
    try:
        futures = {executor.submit(play, job): job for job in jobs}
        for future in as_completed(futures):
            yield futures[future], future.result()
    except BrokenProcessPool as error:
        raise WorkerError(
            "a worker process was killed, out of memory perhaps; the same command goes on from here, "
            f"with a smaller `--workers` than {workers} if need be"
        ) from error
    finally:
        executor.shutdown(kill_workers=True)
