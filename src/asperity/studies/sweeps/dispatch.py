"""Send batches to the workers of a Dask cluster, and yield their outcomes as they complete.

Dask's `as_completed` does the waiting. Batches are submitted as others complete, not all at once:
ten million combinations would not fit into the scheduler, and the last batches are to be small.

A worker holds nothing that would be lost with it: Dask gives its batches to another one. A batch
that kills its workers repeatedly is set aside and run at the end, one combination at a time; the
combination that kills its worker is recorded as failed.
"""

from __future__ import annotations

import logging
import uuid
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import active_children
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.studies.sweeps.batch import (
    FAILED,
    Batch,
    BatchOutcome,
    error_line,
    machine,
    pack,
    program,
    run_packed_batch,
    warm_up,
)
from asperity.studies.sweeps.new_store import SweepBlock
from asperity.studies.sweeps.store import require_packages
from asperity.studies.sweeps.study import SweepStudy

_PATIENCE = 60.0
"""Longest wait for a scheduler and its first worker [s]."""
_SILENT = logging.CRITICAL + 1
_LEAN = {
    "distributed.worker.profile.enabled": False,
    "distributed.scheduler.active-memory-manager.start": False,
    "distributed.scheduler.work-stealing": False,
}
"""Services switched off in local workers: they manage graphs and data, which a sweep lacks."""


@contextmanager
def connect(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """Give a client that is connected to a Dask cluster.

    Parameters
    ----------
    workers : int, optional
        Local processes of one thread each; by default one for each core.
    scheduler : str, optional
        Address of a scheduler, instead of local processes.
    """
    require_packages("dask", "distributed")
    import dask
    from distributed import Client

    with ExitStack() as stack:
        stack.enter_context(_quiet())
        if scheduler is not None:
            client = _client(scheduler)
        else:
            stack.enter_context(dask.config.set(_LEAN))
            stack.callback(_kill_others, set(active_children()))
            cluster = _local_cluster(workers)
            stack.callback(_close, cluster)
            client = Client(cluster)
        stack.callback(_close, client)
        yield client


def _local_cluster(workers: int | None) -> Any:
    from distributed import LocalCluster

    try:
        return LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None,
            host="127.0.0.1", silence_logs=logging.CRITICAL,
            preload=["asperity.studies.sweeps.ignore_interrupts"],
        )  # fmt: skip
    except Exception as error:  # lack of time, memory, ports or processes
        line = error_line(error, 200)
        raise AsperityError(f"local workers could not be started: {line}") from None


def _kill_others(known: set[Any]) -> None:
    """Kill this process's children that are not known: Dask loses track of restarting workers."""
    for process in set(active_children()) - known:
        with suppress(Exception):
            process.kill()


def _client(scheduler: str) -> Any:
    from distributed import Client

    try:
        client = Client(scheduler, timeout=_PATIENCE / 4.0)
    except Exception as error:  # OSError, TimeoutError or ValueError
        line = error_line(error, 200)
        raise AsperityError(f"no scheduler answers at {scheduler!r}: {line}") from None
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError:
        _close(client)
        raise AsperityError(
            f"the scheduler at {scheduler} has had no worker for {_PATIENCE:g} s; start one with: "
            f"dask worker {scheduler} --nthreads 1"
        ) from None
    return client


def _close(thing: Any) -> None:
    """Close a client or a cluster, without waiting long: results are written by now."""
    with suppress(Exception):
        thing.close(timeout=_PATIENCE / 4.0)


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence Dask's log messages about workers that come and go."""
    # Tornado's messages about closed connections help nobody; they stay silenced.
    logging.getLogger("tornado.application").setLevel(logging.CRITICAL)
    # Dask gives some of its loggers levels of their own.
    names = [n for n in logging.root.manager.loggerDict if n.partition(".")[0] == "distributed"]
    before = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(_SILENT)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
    # After an error they stay silenced: a client whose scheduler went away prints tracebacks of
    # its connections until the process ends.
    for name, level in before.items():
        logging.getLogger(name).setLevel(level)


def count_cores(client: Any) -> int:
    """Return how many combinations the cluster runs at once, at least one."""
    return max(sum(client.nthreads().values()), 1)


_QUEUED_PER_CORE = 3
"""Batches that the scheduler holds at once, for each core."""
_LAST_PER_CORE = 4
"""Batches into which the remaining combinations are cut, for each core: batches shrink towards the
end, so that no worker is idle long."""


class Job(NamedTuple):
    """Combinations of one block that are to be run."""

    block: SweepBlock
    places: NDArray[np.int64]
    """Indices in the block."""

    @property
    def numbers(self) -> NDArray[np.int64]:
        """The numbers of the combinations in the study."""
        return self.places + self.block.first


def make_batch(
    study: SweepStudy, numbers: Sequence[int] | NDArray[np.int64], limit: float | None = None
) -> Batch:
    """Return the batch of the combinations with these numbers, each of at most `limit` seconds."""
    return Batch(
        study.kind, {**study.fixed, **study.extras}, str(study.folder), study.design.seed,
        study.keep, study.more,
        study.design.columns(list(map(int, numbers))), program(), limit,
    )  # fmt: skip


def check_workers(client: Any, first: Batch | None) -> None:
    """Raise `AsperityError` if a worker lacks asperity or has another version of it.

    All workers run the batch `first`, if given, so that they load its kernels at the same time.
    """
    try:
        found = client.run(warm_up, first)
    except Exception as error:
        raise _stopped(client, error) from None
    for address, other in found.items():
        if other != program():
            raise AsperityError(
                f"the worker at {address} runs {other}; the sweep was started by {program()}: "
                "install the same everywhere"
            )


def run_on_cluster(
    client: Any, study: SweepStudy, jobs: Sequence[Job], limit: float | None = None
) -> Iterator[tuple[Job, BatchOutcome]]:
    """Yield jobs, or parts of them, with their outcomes, in the order in which they complete."""
    try:
        yield from _run(client, study, jobs, limit)
    except OSError as error:  # of the connection: any call may find that the scheduler is gone
        raise _stopped(client, error) from None


def _run(
    client: Any, study: SweepStudy, jobs: Sequence[Job], limit: float | None
) -> Iterator[tuple[Job, BatchOutcome]]:
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    run = uuid.uuid4().hex[:12]
    completed = as_completed(with_results=True, raise_errors=False)
    parts = _cut(jobs, study.least, lambda: count_cores(client))
    running: dict[str, Job] = {}
    suspects: list[Job] = []

    def submit(job: Job, label: str = "") -> Any:
        key = f"asperity-sweep-{run}{label}-{job.numbers[0]}-{job.numbers.size}"
        batch = pack(make_batch(study, job.numbers, limit))
        return client.submit(run_packed_batch, batch, key=key, pure=False)

    def refill() -> None:
        for job in parts:
            future = submit(job)
            running[future.key] = job
            completed.add(future)
            if len(running) >= _QUEUED_PER_CORE * count_cores(client):
                return

    refill()
    for future, result in completed:
        job = running.pop(future.key)
        # The worker may be gone by now and the state of the future another: the result counts.
        if isinstance(result, BatchOutcome):
            future.release()
            refill()
            yield job, result
        elif isinstance(result, tuple) and isinstance(result[1], KilledWorker):
            suspects.append(job)
            refill()
        else:
            raise _stopped(client, result[1] if isinstance(result, tuple) else result)
    for job in suspects:
        for place in job.places:
            alone = Job(job.block, np.array([place]))
            try:
                outcome = submit(alone, "-alone").result()
            except KilledWorker:
                outcome = BatchOutcome(
                    np.full((1, len(study.numbers)), np.nan), np.array([FAILED], np.int8),
                    ["every worker that ran it died"], machine(),
                )  # fmt: skip
            except Exception as error:
                raise _stopped(client, error) from None
            yield alone, outcome


def _cut(jobs: Sequence[Job], least: int, workers: Callable[[], int]) -> Iterator[Job]:
    """Yield jobs, the last ones in parts of at least `least` combinations."""
    remaining = sum(job.places.size for job in jobs)
    for job in jobs:
        size = max(remaining // (_LAST_PER_CORE * workers()), least, 1)
        parts = max(round(job.places.size / size), 1)
        for places in np.array_split(job.places, parts):
            yield Job(job.block, places)
        remaining -= job.places.size


def _stopped(client: Any, error: Any) -> AsperityError:
    """Return the message for a batch, or a call of the client, that ended without a result."""
    if isinstance(error, AsperityError):
        return error
    if isinstance(error, ImportError):
        return AsperityError(
            f"a worker cannot load asperity ({error_line(error)}): install it there, the same "
            "version"
        )
    name = type(error).__name__
    gone = "ancel" in name or "CommClosed" in name
    if client.status != "running" or error is None or gone:
        return AsperityError(
            "the scheduler went away; completed blocks are in the store, and the same command "
            "resumes the sweep"
        )
    text = error_line(error) if isinstance(error, BaseException) else str(error)
    return AsperityError(f"a worker could not run its batch: {text}")
