"""Backends: the same results from each, and names for what is missing."""

import builtins
import os
import shutil
import sys
from types import SimpleNamespace

import pytest

from anm_gym.errors import BackendError
from anm_gym.scenes.datasets import ROOT_VARIABLE
from train.backends import Backend, run_on


@pytest.fixture
def square():
    """A function made here travels to a worker by value, wherever the tests were started."""

    def play(job):
        import torch

        return job * job, os.getpid(), torch.get_num_threads()

    return play


def results_of(backend, play, jobs):
    return dict(run_on(backend, play, jobs))


@pytest.mark.needs_dask
def test_dask_plays_every_job_in_a_worker_of_one_thread(square):
    options = {"processes": False}
    results = results_of(Backend("dask", 2, options), square, [2, 3, 4])
    assert {job: value for job, (value, _, _) in results.items()} == {2: 4, 3: 9, 4: 16}
    assert {threads for _, _, threads in results.values()} == {1}


@pytest.mark.slow
@pytest.mark.needs_dask
def test_dask_scheduler_of_the_user_is_used(square):
    import distributed

    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        results = results_of(Backend("dask", 2, {"address": cluster.scheduler_address}), square, [5])
    assert results[5][0] == 25
    assert results[5][1] != os.getpid()


@pytest.mark.needs_dask
def test_cluster_of_one_worker_is_refused(square):
    """On such a cluster joblib would play in this process without a word."""
    with pytest.raises(BackendError, match="must have at least 2 workers, got 1"):
        results_of(Backend("dask", 1, {"processes": False}), square, [1])


@pytest.mark.needs_dask
def test_workers_that_play_two_episodes_at_once_are_refused(square):
    """Each episode would be charged the other's CPU time."""
    backend = Backend("dask", 2, {"processes": False, "threads_per_worker": 2})
    with pytest.raises(
        BackendError, match="must have one thread, got 2; start `dask worker` with --nthreads 1"
    ):
        results_of(backend, square, [1])


@pytest.mark.needs_dask
@pytest.mark.parametrize("more", [{}, {"address": "tcp://127.0.0.1:9", "timeout": 0.5}])
def test_option_that_dask_does_not_have_is_named_before_any_worker_starts(more, square):
    with pytest.raises(ValueError, match=r"`options` must be those of distributed\.Client, .* got bar, foo;"):
        results_of(Backend("dask", 2, {"foo": 1, "n_workers": 2, "bar": 2, **more}), square, [1])


@pytest.mark.needs_dask
def test_episode_that_dask_gave_up_ends_in_one_line():
    def play(_job):
        import distributed

        worker = SimpleNamespace(address="tcp://worker")
        raise distributed.KilledWorker("play", worker, 3)  # as its scheduler does when workers keep dying

    with pytest.raises(BackendError, match=r"dask gave an episode up: .*; the same command plays what is"):
        results_of(Backend("dask", 2, {"processes": False}), play, [1, 2])


@pytest.mark.needs_dask
def test_silent_scheduler_is_named(square):
    backend = Backend("dask", 1, {"address": "tcp://127.0.0.1:9", "timeout": 0.5})
    with pytest.raises(BackendError, match=r"no dask scheduler answers at tcp://127\.0\.0\.1:9"):
        results_of(backend, square, [1])


class Task:
    """A task of the stand-in for submitit."""

    def __init__(self, play, job):
        self.play, self.job, self.is_cancelled = play, job, False

    def result(self):
        return self.play(self.job)

    def done(self):
        return False

    def cancel(self):
        self.is_cancelled = True


class Executor:
    """Stands in for submitit's."""

    def __init__(self, folder, cluster):
        self.folder, self.cluster = folder, cluster
        Executor.last = self

    def update_parameters(self, **options):
        self.options = options

    def map_array(self, play, jobs):
        self.tasks = [Task(play, job) for job in jobs]
        return self.tasks


@pytest.fixture
def submitit(monkeypatch):
    helpers = SimpleNamespace(as_completed=lambda tasks, poll_frequency: reversed(tasks))
    monkeypatch.setitem(sys.modules, "submitit", SimpleNamespace(AutoExecutor=Executor, helpers=helpers))


def test_slurm_backend_submits_an_array_and_yields_what_ends_first(submitit, square, tmp_path):
    backend = Backend("slurm", 3, {"slurm_partition": "cpu"}, tmp_path)
    assert [job for job, _ in run_on(backend, square, [2, 3])] == [3, 2]
    assert (Executor.last.cluster, Executor.last.folder) == ("slurm", tmp_path)
    expected = {"cpus_per_task": 1, "slurm_array_parallelism": 3, "slurm_partition": "cpu"}
    assert Executor.last.options == expected


def test_interrupted_run_cancels_its_tasks(submitit, square, tmp_path):
    results = run_on(Backend("slurm", folder=tmp_path), square, [2, 3])
    next(results)
    results.close()
    assert all(task.is_cancelled for task in Executor.last.tasks)


def test_lost_task_is_reported_after_the_others_have_been_handed_over(submitit, square, tmp_path):
    def play(job):
        if job == 3:
            raise RuntimeError("task 1 was killed: out of memory")  # as submitit says it
        return square(job)

    done = []
    with pytest.raises(BackendError, match=r"1 of 3 tasks ended without .* out of memory; the same command"):
        done.extend(job for job, _ in run_on(Backend("slurm", folder=tmp_path), play, [2, 3, 4]))
    assert done == [4, 2]


def test_worker_finds_the_datasets_of_the_process_that_asked(submitit, tmp_path, monkeypatch):
    monkeypatch.setenv(ROOT_VARIABLE, "/data")
    results = run_on(Backend("slurm", folder=tmp_path), lambda job: os.environ[ROOT_VARIABLE], [1, 2])
    assert next(results) == (2, "/data")
    monkeypatch.setenv(ROOT_VARIABLE, "/of/the/worker")
    assert next(results) == (1, "/data")


@pytest.mark.slow
@pytest.mark.needs_submitit
def test_slurm_backend_plays_in_processes_of_their_own(square, tmp_path):
    backend = Backend("slurm", 2, {"cluster": "local", "timeout_min": 1}, tmp_path)
    results = results_of(backend, square, [2, 3])
    assert {job: value for job, (value, _, _) in results.items()} == {2: 4, 3: 9}
    assert os.getpid() not in {pid for _, pid, _ in results.values()}


@pytest.mark.needs_submitit
def test_machine_without_slurm_is_told(square, tmp_path):
    if shutil.which("srun"):
        pytest.skip("this machine has Slurm")
    with pytest.raises(BackendError, match="Slurm must be at hand, got none"):
        results_of(Backend("slurm", 1, folder=tmp_path), square, [1])


@pytest.mark.parametrize(("name", "package"), [("dask", "distributed"), ("slurm", "submitit")])
def test_missing_package_is_named(name, package, square, monkeypatch):
    real_import = builtins.__import__

    def without_package(wanted, *rest, **more):
        if wanted == package:
            raise ModuleNotFoundError(f"No module named '{package}'", name=package)
        return real_import(wanted, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without_package)
    with pytest.raises(BackendError, match=rf"needs {package}; pip install 'anm-gym\[cluster\]'"):
        results_of(Backend(name), square, [1])


@pytest.mark.parametrize("name", ["loky", "dask", "slurm"])
def test_no_worker_plays_in_this_process_on_any_backend(name, square):
    assert results_of(Backend(name, 0), square, [3])[3][1] == os.getpid()


def test_no_job_starts_no_cluster(square):
    assert results_of(Backend("slurm"), square, []) == {}


def test_wrong_backend_is_refused():
    with pytest.raises(ValueError, match="unknown backend 'ray'; choose one of: loky, dask, slurm"):
        Backend("ray")
    with pytest.raises(ValueError, match="`options` must be empty for the backend loky, got address"):
        Backend("loky", options={"address": "x"})
