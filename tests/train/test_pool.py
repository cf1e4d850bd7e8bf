"""Worker processes: conditions, order, what is said when one dies."""

import os

import pytest

from train.pool import WorkerError, run_jobs


@pytest.fixture
def conditions():
    """A function made here travels to a worker by value, wherever the tests were started."""

    def play(job):
        import torch

        keeps_subnormals = float(torch.tensor([1e-40]) * 1.0) > 0.0
        return os.environ.get("OMP_NUM_THREADS"), torch.get_num_threads(), keeps_subnormals, job * job

    return play


@pytest.fixture
def die():
    return lambda job: os._exit(9)


def test_every_worker_has_one_thread_and_keeps_subnormal_numbers(conditions):
    results = list(run_jobs(conditions, [2, 3, 4], workers=2))
    assert sorted(results) == [(job, ("1", 1, True, job * job)) for job in (2, 3, 4)]


def test_killed_worker_is_named(die):
    with pytest.raises(WorkerError, match="a worker process was killed, out of memory perhaps"):
        list(run_jobs(die, [1], workers=1))


def test_no_worker_plays_in_this_process():
    assert list(run_jobs(lambda job: (os.getpid(), job), [5], workers=0)) == [(5, (os.getpid(), 5))]


def test_no_job_starts_nothing(die):
    assert list(run_jobs(die, [], workers=2)) == []


def test_negative_number_of_workers_is_refused(die):
    with pytest.raises(ValueError, match="`workers` must be >= 0, got -1"):
        list(run_jobs(die, [], workers=-1))
