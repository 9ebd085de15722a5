"""Where the combinations are worked on: local processes, or a Dask cluster that runs already."""

from __future__ import annotations

import logging
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import active_children
from typing import Any

from asperity.errors import AsperityError
from asperity.studies.sweeps.store import needs

_PATIENCE = 60.0
"""How long a scheduler, and its first worker, are waited for [s]."""
_LEAN = {
    "distributed.worker.profile.enabled": False,
    "distributed.scheduler.active-memory-manager.start": False,
    "distributed.scheduler.work-stealing": False,
}
"""What local workers do without: it looks after graphs and data, of which a sweep has none."""


def local_workers() -> int:
    """Return how many cores this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


@contextmanager
def connected(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """Give a client of a Dask cluster.

    Parameters
    ----------
    workers : int, optional
        Local processes of one thread each; by default one for each core.
    scheduler : str, optional
        Address of a scheduler, instead of local processes.
    """
    needs("dask", "distributed")
    import dask
    from distributed import Client, LocalCluster

    if scheduler is not None:
        client = _client(scheduler)
        try:
            with _quiet():
                yield client
        finally:
            _close(client)
        return
    before = set(active_children())
    with _quiet(), dask.config.set(_LEAN):
        try:
            cluster = LocalCluster(
                n_workers=workers or local_workers(), threads_per_worker=1, processes=True,
                dashboard_address=None, host="127.0.0.1", silence_logs=logging.CRITICAL,
                preload=["asperity.studies.sweeps.uninterrupted"],
            )  # fmt: skip
        except Exception as error:  # by what is short: time, memory, ports, processes
            line = " ".join(str(error).split())[:200] or type(error).__name__
            raise AsperityError(f"local workers could not be started: {line}") from None
        try:
            client = Client(cluster)
            try:
                yield client
            finally:
                _close(client)
        finally:
            _close(cluster)
            # A worker that was just being started anew is forgotten by its nanny.
            for process in set(active_children()) - before:
                with suppress(Exception):
                    process.kill()


def _client(scheduler: str) -> Any:
    from distributed import Client

    try:
        client = Client(scheduler, timeout=_PATIENCE / 4.0)
    except Exception as error:  # OSError, TimeoutError, ValueError, by what is wrong
        line = " ".join(str(error).split())[:200] or type(error).__name__
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
    """Close a client or a cluster. Results are safe by now: one that takes its time is left."""
    with suppress(Exception):
        thing.close(timeout=_PATIENCE / 4.0)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask's remarks about workers that come and go to itself."""
    # What tornado says of connections that end is of no use to anybody; it stays silent.
    logging.getLogger("tornado.application").setLevel(logging.CRITICAL)
    loud = logging.getLogger("distributed")
    before = loud.level
    loud.setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        loud.setLevel(before)


def cores(client: Any) -> int:
    """Return how many combinations the cluster works on at once, one at least."""
    return max(sum(client.nthreads().values()), 1)
