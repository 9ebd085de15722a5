"""Run a sweep: batches go to workers, and each block is written as soon as it is complete."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import is_compiled
from asperity.errors import AsperityError, require_positive
from asperity.studies.sweeps.batch import (
    DONE,
    FAILED,
    WAITING,
    BatchOutcome,
    now,
    run_batch,
    session_facts,
)
from asperity.studies.sweeps.dispatch import Job, check_workers, connect, make_batch, run_on_cluster
from asperity.studies.sweeps.store import BlockResults, SweepStore, open_store, require_packages
from asperity.studies.sweeps.study import SweepStudy, read_study

_LOG = logging.getLogger(__name__)
_LOG_INTERVAL = 30.0
"""Time between log lines about progress [s]."""
_KERNELS = {
    "drag": ("dynamics.dragged_hand.periodic_motion", "drag_until_repeat"),
    "scene": ("contact.geom_tick", "tick"),
}
"""Module and name of a kernel that a combination of either kind needs."""


class SweepProgress(NamedTuple):
    """How far a sweep has come."""

    total: int
    done: int
    """Combinations with a result, from this run or an earlier one."""
    failed: int
    """Combinations with an error, likewise."""
    note: str
    """What is being prepared, such as "starting workers"; "" while combinations run."""


class SweepSummary(NamedTuple):
    """Result of `run_sweep`."""

    path: Path
    total: int
    done: int
    failed: int
    computed: int
    """Combinations run now; the others were in the store already."""
    seconds: float
    """Time from the first batch to the last, without starting workers."""
    first_error: str
    """Error of the failed combination with the lowest number; "" if none failed."""


class _Place(NamedTuple):
    """Where combinations run, and for how long at most."""

    workers: int | None
    scheduler: str | None
    client: Any
    limit: float | None


ReportProgress = Callable[[SweepProgress], None]


def run_sweep(
    study: SweepStudy | str | Path | Mapping[str, object],
    store: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    overwrite: bool = False,
    retry_failed: bool = False,
    any_version: bool = False,
    extend: bool = False,
    limit: float | None = None,
    client: Any = None,
    progress: ReportProgress = lambda _: None,
) -> SweepSummary:
    """Run all combinations of a study that its store does not hold yet.

    Parameters
    ----------
    study : SweepStudy, path or mapping
        STUDY.toml, or its content; see `read_study`.
    store : path
        The Zarr store, which is created or resumed. `open_sweep` reads it, also while it grows.
    workers : int, optional
        Local processes; by default one for each core. 0: in this process, without Dask.
    scheduler : str, optional
        Address of a Dask scheduler, instead of local processes. Its workers need the same version
        of asperity, and the files that the study names under the same paths.
    overwrite : bool
        Replace an existing store instead of resuming it.
    retry_failed : bool
        Run combinations again that failed before.
    any_version : bool
        Resume a store that another version began.
    extend : bool
        Take over what a store of a study with other values, or other numbers under `keep`, else
        the same, has of this.
    limit : float, optional
        Longest time of one combination [s]; one that takes longer fails with that reason.
    client : distributed.Client, optional
        A client that is connected, instead of `workers` and `scheduler`; it stays open.
    progress : callable
        Called whenever a block was written.

    Raises
    ------
    AsperityError
        A study that is not valid; a store of another study or version; no scheduler. One line.
        What was written stays.

    Notes
    -----
    Local processes import the main module of the program: in a script, call this under
    `if __name__ == "__main__":`.

    Examples
    --------
    >>> asperity.studies.sweeps.run.run_sweep("study.toml", "out/study.zarr")
    >>> data = asperity.studies.sweeps.store.open_sweep("out/study.zarr")
    """
    require_packages("zarr")
    if workers is not None and workers < 0:
        raise AsperityError(f"workers must be 0 or above, got {workers}")
    if sum(given is not None for given in (scheduler, workers, client)) > 1:
        raise AsperityError("give only one of workers, scheduler and client")
    if limit is not None:
        require_positive("limit", limit, "s")
    study = study if isinstance(study, SweepStudy) else read_study(study)
    with (
        open_store(
            Path(store),
            study,
            block_size=study.block,
            overwrite=overwrite,
            any_version=any_version,
            extend=extend,
        ) as results,
        ExitStack() as stack,
    ):
        states = results.verified_states()
        if retry_failed:
            states[states == FAILED] = WAITING
        jobs = [
            Job(block, places)
            for block in results.blocks
            if (places := np.flatnonzero(states[block.places] == WAITING)).size
        ]
        computed = sum(job.places.size for job in jobs)
        begun = time.perf_counter()
        if jobs:
            place = _Place(workers, scheduler, client, limit)
            outcomes = _start(study, stack, place, jobs, states, progress)
            where = "scheduler" if scheduler or client else "local"
            results.sessions.append(session_facts() | {"where": where, "ended": None})
            results.write_sessions()
            begun = time.perf_counter()
            _write_outcomes(results, outcomes, states, progress)
            results.sessions[-1] |= {"ended": now(), "computed": computed}
            results.write_sessions()
        seconds = time.perf_counter() - begun
        counts = _progress_of(states)
        return SweepSummary(
            results.path, counts.total, counts.done, counts.failed, computed, seconds,
            results.first_error(states),
        )  # fmt: skip


def _start(
    study: SweepStudy,
    stack: ExitStack,
    place: _Place,
    jobs: list[Job],
    states: NDArray[np.int8],
    progress: ReportProgress,
) -> Iterator[tuple[Job, BatchOutcome]]:
    """Return the outcomes of jobs to come, from this process or from a cluster that is ready."""
    workers, scheduler, client, limit = place
    local = scheduler is None and client is None
    if local and study.kind in _KERNELS and not is_compiled(*_KERNELS[study.kind]):
        # Compile once here rather than once in every worker.
        progress(_progress_of(states, "compiling first"))
        run_batch(make_batch(study, [0]))
    if workers == 0:
        return ((job, run_batch(make_batch(study, job.numbers, limit))) for job in jobs)
    note = "starting workers" if local else "connecting to the scheduler"
    progress(_progress_of(states, note))
    wanted = None if workers is None else min(workers, len(jobs))
    if client is None:
        client = stack.enter_context(connect(wanted, scheduler))
    check_workers(client, make_batch(study, [0]) if study.kind == "drag" else None)
    return run_on_cluster(client, study, jobs, limit)


def _write_outcomes(
    store: SweepStore,
    outcomes: Iterator[tuple[Job, BatchOutcome]],
    states: NDArray[np.int8],
    progress: ReportProgress,
) -> None:
    """Write each block as soon as it is complete, and note it in `states`.

    A block in which only some combinations waited keeps its other results.
    """
    machines: set[str] = set()
    incomplete: dict[int, BlockResults] = {}
    begun = last = time.monotonic()
    before = int(np.count_nonzero(states))
    for job, outcome in outcomes:
        block = job.block
        if outcome.machine not in machines:
            # Kept at once: a sweep that is broken off has them too.
            machines.add(outcome.machine)
            store.sessions[-1]["machines"] = sorted(machines)
            store.write_sessions()
        results = incomplete.pop(block.first, None)
        if results is None and states[block.places].any():
            results = store.read(block)
            results.states[:] = states[block.places]
        results = results or BlockResults.empty(block.size, len(store.study.numbers))
        results.insert(job.places, outcome)
        if (results.states == WAITING).any():
            incomplete[block.first] = results
            continue
        store.write(block, results)
        states[block.places] = results.states
        current = _progress_of(states)
        progress(current)
        if time.monotonic() - last > _LOG_INTERVAL:
            last = time.monotonic()
            known = current.done + current.failed
            rate = (known - before) / (last - begun)
            _LOG.info(
                "%d of %d combinations, %d failed; %.3g per second, %.0f s to go",
                known, current.total, current.failed, rate, (current.total - known) / rate,
            )  # fmt: skip


def _progress_of(states: NDArray[np.int8], note: str = "") -> SweepProgress:
    done, failed = (int(np.count_nonzero(states == state)) for state in (DONE, FAILED))
    return SweepProgress(states.size, done, failed, note)
