"""Connect to the workers of a sweep: local processes, or a running Dask cluster."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import active_children
from typing import Any

from asperity.errors import AsperityError
from asperity.studies.sweeps.batch import error_line
from asperity.studies.sweeps.store import require_packages

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
