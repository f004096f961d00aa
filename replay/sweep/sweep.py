"""The sweep itself: jobs to workers, results to the journal as they come."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.replay.sweep.job import run_job
from axialnav.replay.sweep.plan import Job
from axialnav.replay.sweep.results import TABLE, Journal, write_table

AHEAD = 4  # jobs waiting per worker
CONNECT_S = 10.0
MAX_BREAKS = 3


@dataclass(frozen=True)
class Sweep:
    """Rows in the order of the plan; ``done_before`` of them were there when the sweep began."""

    folder: Path
    rows: list[dict[str, Any]]
    done_before: int


def sweep(
    jobs: Sequence[Job],
    folder: Path,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Sweep:
    """Run all jobs that the folder does not hold yet, and write the table of all.

    Every result is on disk before it counts, so a sweep that was killed goes on where it was.  Results do not depend on
    where or in which order jobs ran.

    Parameters
    ----------
    jobs
        From :func:`~axialnav.replay.sweep.plan.plan`.
    folder
        Gets ``journal.jsonl`` and ``results.parquet``.
    workers
        Local processes; 1 runs in this one.
    scheduler
        Address of a Dask scheduler; its workers are used instead.
    progress
        Called with the share done, 0 .. 1.

    Raises
    ------
    ConfigError
        The folder cannot be written, or the scheduler cannot be reached.
    FlightError
        Workers die again and again.
    """
    journal = Journal(folder)
    before = sum(job.key in journal.done for job in jobs)
    try:
        for done, row in enumerate(_rows(_open(jobs, journal), workers, scheduler), before + 1):
            journal.add(row)
            if progress is not None:
                progress(done / len(jobs))
    finally:
        journal.close()
    rows = [journal.done[job.key] for job in jobs]
    write_table(folder / TABLE, rows)
    return Sweep(folder, rows, before)


def _open(jobs: Sequence[Job], journal: Journal) -> list[Job]:
    return [job for job in jobs if job.key not in journal.done]


def _rows(jobs: list[Job], workers: int, scheduler: str | None) -> Iterator[dict[str, Any]]:
    if scheduler is not None:
        with _dask(scheduler) as (pool, capacity):
            yield from _through(pool, jobs, capacity)
    elif workers == 1:
        yield from map(run_job, jobs)
    else:
        yield from _local(jobs, workers)


def _local(jobs: list[Job], workers: int) -> Iterator[dict[str, Any]]:
    """Processes of this machine; a pool that breaks because one was killed is made anew with the jobs that are left."""
    left = {job.key: job for job in jobs}
    context = multiprocessing.get_context("spawn")
    for _ in range(MAX_BREAKS + 1):
        try:
            with ProcessPoolExecutor(workers, mp_context=context) as pool:
                for row in _through(pool, list(left.values()), workers):
                    left.pop(row["key"])
                    yield row
                return
        except BrokenProcessPool:
            continue
    raise FlightError(
        f"workers were killed {MAX_BREAKS + 1} times with {len(left)} replays to go; give it more memory or fewer "
        f"--workers and start the sweep again, what is done is kept"
    )


def _through(pool: Executor, jobs: list[Job], workers: int) -> Iterator[dict[str, Any]]:
    """Results as they come, with a few jobs waiting per worker and no more in flight."""
    waiting = iter(jobs)
    running: set[Future[dict[str, Any]]] = set()
    while True:
        while len(running) < AHEAD * workers:
            job = next(waiting, None)
            if job is None:
                break
            running.add(pool.submit(run_job, job))
        if not running:
            return
        finished, running = wait(running, return_when=FIRST_COMPLETED)
        for future in finished:
            yield future.result()


@contextmanager
def _dask(address: str) -> Iterator[tuple[Executor, int]]:
    """Executor of a Dask cluster, and how many threads it has.

    Dask runs the job of a worker that died on another one, and hands every result over once.
    """
    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise ConfigError("--scheduler needs Dask; install it with: pip install 'axialnav[cluster]'") from None
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        why = " ".join(str(error).split())
        raise ConfigError(f"--scheduler {address}: no Dask scheduler answers there ({why[:120]})") from None
    try:
        threads = sum(client.nthreads().values())
        if threads == 0:
            raise ConfigError(
                f"--scheduler {address}: the cluster has no workers; start some with: dask worker {address}"
            )
        yield client.get_executor(pure=False), threads
    finally:
        client.close()
