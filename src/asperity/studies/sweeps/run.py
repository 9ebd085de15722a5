"""Running a sweep: `run_sweep`. Batches go to workers; what comes back is written, block by block.

A worker holds nothing that is not computed anew if it dies: Dask gives its batches to another one.
A batch that workers die of, again and again, is taken apart at the end, one combination at a
time, and the one that kills them is recorded as failed.
"""

from __future__ import annotations

import logging
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import is_compiled
from asperity.errors import AsperityError
from asperity.studies.sweeps.blocks import Block
from asperity.studies.sweeps.cluster import connected, cores
from asperity.studies.sweeps.provenance import facts, now
from asperity.studies.sweeps.store import SweepStore, needs, opened_store
from asperity.studies.sweeps.study import SweepStudy, read_study
from asperity.studies.sweeps.work import (
    DONE,
    FAILED,
    WAITING,
    Batch,
    BatchOutcome,
    machine,
    packed,
    program,
    ready,
    told,
    work,
    work_packed,
)

_LOG = logging.getLogger(__name__)
_AHEAD = 3
"""Batches that are with the scheduler, for each core."""
_LAST = 4
"""Batches into which, for each core, what is left is cut: they get smaller towards the end."""
_TELL = 30.0
"""How often the log says how far it is [s]."""


class SweepProgress(NamedTuple):
    """How far a sweep is."""

    total: int
    done: int
    """With a result, in this run or before."""
    failed: int
    """With an error, likewise."""
    note: str
    """What goes on besides: starting, compiling."""


class SweepSummary(NamedTuple):
    """What came of a sweep."""

    path: Path
    total: int
    done: int
    failed: int
    computed: int
    """Combinations of this run; the others were in the store already."""
    seconds: float
    """From the first batch to the last, without starting workers."""
    first_error: str
    """Of the combination with the smallest number; "" if none failed."""


Tell = Callable[[SweepProgress], None]


@dataclass
class _Job:
    """Combinations of one block that are still to be worked on."""

    block: Block
    places: NDArray[np.int64]
    """In the block."""


@dataclass
class _Half:
    """A block of which some combinations are known."""

    values: NDArray[np.float64]
    states: NDArray[np.int8]
    errors: dict[int, str]
    again: bool

    def take(self, places: NDArray[np.int64], outcome: BatchOutcome) -> None:
        """Put in what came of the combinations at some places."""
        self.values[places] = outcome.values
        self.states[places] = outcome.states
        for i, place in enumerate(places):
            self.errors.pop(int(place), None)
            if i in outcome.errors:
                self.errors[int(place)] = outcome.errors[i]


def run_sweep(
    study: SweepStudy | str | Path | Mapping[str, Any],
    store: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    overwrite: bool = False,
    retry_failed: bool = False,
    any_version: bool = False,
    progress: Tell = lambda _: None,
) -> SweepSummary:
    """Run all combinations of a study that its store does not hold yet.

    Parameters
    ----------
    study : SweepStudy, path or mapping
        STUDY.toml, or what would stand in it; see `read_study`.
    store : path
        The Zarr store: made, or gone on with. `open_sweep` reads it, also while it grows.
    workers : int, optional
        Local processes; by default one for each core. 0: in this process, without Dask.
    scheduler : str, optional
        Address of a Dask scheduler, instead of local processes. Its workers need the same version
        of asperity, and the files that the study names under the same path.
    overwrite : bool
        Whether to begin anew.
    retry_failed : bool
        Whether combinations that failed before are run again.
    any_version : bool
        Whether to go on with a store that another version began.
    progress : callable
        Called whenever something was written.

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
    needs("zarr")
    if workers is not None and workers < 0:
        raise AsperityError(f"workers must be 0 or above, got {workers}")
    if scheduler is not None and workers is not None:
        raise AsperityError("give workers or a scheduler, not both: its workers are what they are")
    study = study if isinstance(study, SweepStudy) else read_study(study)
    path = Path(store)
    with (
        opened_store(
            path, study, most=study.block, overwrite=overwrite, any_version=any_version
        ) as kept,
        ExitStack() as stack,
    ):
        states = kept.sound_states()
        jobs, halves = _open_jobs(kept, states, retry_failed)
        left = sum(job.places.size for job in jobs)
        begun = time.perf_counter()
        if jobs:
            compute = _backend(study, stack, workers, scheduler, len(jobs), states, progress)
            session = kept.add_session(
                facts() | {"where": "scheduler" if scheduler else "local", "ended": None}
            )
            begun = time.perf_counter()
            machines = _compute(kept, compute(jobs), states, halves, progress)
            kept.update_session(
                session, {"ended": now(), "computed": left, "machines": sorted(machines)}
            )
        return _summary(kept, states, left, time.perf_counter() - begun)


def _summary(kept: SweepStore, states: NDArray[np.int8], left: int, took: float) -> SweepSummary:
    failed = np.flatnonzero(states == FAILED)
    error = ""
    if failed.size:
        block = next(b for b in kept.blocks if b.first <= failed[0] < b.first + b.size)
        error = kept.errors(block).get(int(failed[0]) - block.first, "")
    done = int(np.count_nonzero(states == DONE))
    return SweepSummary(kept.path, states.size, done, failed.size, left, took, error)


def _open_jobs(
    kept: SweepStore, states: NDArray[np.int8], retry_failed: bool
) -> tuple[list[_Job], dict[int, _Half]]:
    """Return what is to be worked on, and the blocks of which a part is known."""
    jobs, halves = [], {}
    for block in kept.blocks:
        part = states[block.first : block.first + block.size]
        open_ = part == WAITING
        if retry_failed:
            open_ |= part == FAILED
        places = np.flatnonzero(open_)
        if not places.size:
            continue
        jobs.append(_Job(block, places))
        if places.size < block.size:
            halves[block.first] = _Half(
                kept.numbers(block), part.copy(), kept.errors(block), again=True
            )
            part[places] = halves[block.first].states[places] = WAITING
        elif part.any():
            halves[block.first] = _Half(
                np.full((block.size, len(kept.study.keep)), np.nan),
                np.zeros(block.size, np.int8), {}, again=True,
            )  # fmt: skip
            part[:] = WAITING
    return jobs, halves


def _compute(
    kept: SweepStore,
    results: Iterator[tuple[_Job, BatchOutcome]],
    states: NDArray[np.int8],
    halves: dict[int, _Half],
    progress: Tell,
) -> set[str]:
    """Write what comes back, as soon as a block is whole; return the machines that it came from."""
    machines: set[str] = set()
    begun = last = time.monotonic()
    before = int(np.count_nonzero(states))
    for job, outcome in results:
        block = job.block
        half = halves.pop(block.first, None) or _Half(
            np.full((block.size, len(kept.study.keep)), np.nan),
            np.zeros(block.size, np.int8), {}, again=False,
        )  # fmt: skip
        half.take(job.places, outcome)
        machines.add(outcome.machine)
        if (half.states == WAITING).any():
            halves[block.first] = half
            continue
        kept.write(block, half.values, half.states, half.errors, again=half.again)
        states[block.first : block.first + block.size] = half.states
        told = _told(states, "")
        progress(told)
        if time.monotonic() - last > _TELL:
            last = time.monotonic()
            known = told.done + told.failed
            rate = (known - before) / (last - begun)
            _LOG.info(
                "%d of %d, %d failed; %.3g a second, %.0f s left",
                known, told.total, told.failed, rate, (told.total - known) / rate,
            )  # fmt: skip
    return machines


def _told(states: NDArray[np.int8], note: str) -> SweepProgress:
    done, failed = (int(np.count_nonzero(states == state)) for state in (DONE, FAILED))
    return SweepProgress(states.size, done, failed, note)


_KERNELS = {
    "drag": ("dynamics.dragged_hand.integrator", "force_at"),
    "scene": ("contact.geom_tick", "tick"),
}
"""Module and name of a kernel that a combination of either kind needs."""


def _backend(
    study: SweepStudy,
    stack: ExitStack,
    workers: int | None,
    scheduler: str | None,
    jobs: int,
    states: NDArray[np.int8],
    progress: Tell,
) -> Callable[[Sequence[_Job]], Iterator[tuple[_Job, BatchOutcome]]]:
    """Return what works on jobs: this process, or a cluster that is ready."""
    module, name = _KERNELS[study.kind]
    if scheduler is None and not is_compiled(module, name):
        # Once here, instead of once in every worker.
        progress(_told(states, "compiling first"))
        work(_batch(study, [0]))
    if workers == 0:
        return lambda todo: ((job, work(_batch(study, _numbers(job)))) for job in todo)
    progress(_told(states, "starting workers" if scheduler is None else "asking the scheduler"))
    wanted = None if workers is None else min(workers, jobs)
    client = stack.enter_context(connected(wanted, scheduler))
    _agree(client, _batch(study, [0]) if study.kind == "drag" else None)
    return lambda todo: _on_cluster(client, study, todo)


def _agree(client: Any, first: Batch | None) -> None:
    """Refuse workers without asperity, or with another version; the others load it meanwhile.

    A drag is run by each of them, so that its kernels are loaded.
    """
    try:
        found = client.run(ready, first)
    except Exception as error:
        raise _stopped(client, (type(error), error, None)) from None
    for address, other in found.items():
        if other != program():
            raise AsperityError(
                f"the worker at {address} runs {other}; the sweep was started by {program()}: "
                "install the same everywhere"
            )


def _numbers(job: _Job) -> NDArray[np.int64]:
    return job.places + job.block.first


def _batch(study: SweepStudy, numbers: Sequence[int] | NDArray[np.int64]) -> Batch:
    return Batch(
        study.kind, dict(study.fixed), str(study.folder), study.design.seed, study.keep,
        study.design.columns(list(map(int, numbers))), program(),
    )  # fmt: skip


def _on_cluster(
    client: Any, study: SweepStudy, todo: Sequence[_Job]
) -> Iterator[tuple[_Job, BatchOutcome]]:
    """Yield jobs with what came of them, in the order in which they are ready."""
    try:
        yield from _from_workers(client, study, todo)
    except OSError as error:  # of the connection: the scheduler may go away at any call
        raise _stopped(client, (type(error), error, None)) from None


def _from_workers(
    client: Any, study: SweepStudy, todo: Sequence[_Job]
) -> Iterator[tuple[_Job, BatchOutcome]]:
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    run = uuid.uuid4().hex[:12]
    finished = as_completed(with_results=True, raise_errors=False)
    jobs, waiting, suspects = _cut(todo, study.least, lambda: cores(client)), {}, []

    def submit(job: _Job) -> None:
        numbers = _numbers(job)
        key = f"asperity-sweep-{run}-{numbers[0]}-{numbers.size}"
        future = client.submit(work_packed, packed(_batch(study, numbers)), key=key, pure=False)
        waiting[future.key] = job
        finished.add(future)

    def refill() -> None:
        for job in jobs:
            submit(job)
            if len(waiting) >= _AHEAD * cores(client):
                return

    refill()
    for future, result in finished:
        job = waiting.pop(future.key)
        # By now the worker may be gone and the state of the future another: the result counts.
        if isinstance(result, BatchOutcome):
            future.release()
            refill()
            yield job, result
        elif isinstance(result, tuple) and isinstance(result[1], KilledWorker):
            suspects.append(job)
            refill()
        else:
            raise _stopped(client, result)
    for job in suspects:
        for place in job.places:
            yield _alone(client, study, _Job(job.block, np.array([place])), run)


def _cut(todo: Sequence[_Job], least: int, at_once: Callable[[], int]) -> Iterator[_Job]:
    """Yield jobs, the last ones in pieces, so that all workers have something to do to the end."""
    left = sum(job.places.size for job in todo)
    for job in todo:
        size = max(left // (_LAST * at_once()), least, 1)
        pieces = max(round(job.places.size / size), 1)
        for places in np.array_split(job.places, pieces):
            yield _Job(job.block, places)
        left -= job.places.size


def _alone(client: Any, study: SweepStudy, job: _Job, run: str) -> tuple[_Job, BatchOutcome]:
    """Work on one combination while nothing else is worked on."""
    from distributed.scheduler import KilledWorker

    numbers = _numbers(job)
    key = f"asperity-sweep-{run}-alone-{numbers[0]}"
    future = client.submit(work_packed, packed(_batch(study, numbers)), key=key, pure=False)
    try:
        return job, future.result()
    except KilledWorker:
        text = "every worker that ran it died"
        nothing = np.full((1, len(study.keep)), np.nan)
        return job, BatchOutcome(nothing, np.array([FAILED], np.int8), {0: text}, machine())
    except Exception as error:
        raise _stopped(client, (type(error), error, None)) from None


def _stopped(client: Any, result: Any) -> AsperityError:
    """Return what to say of a batch that came to no result."""
    error = result[1] if isinstance(result, tuple) else result
    if isinstance(error, AsperityError):
        return error
    if isinstance(error, ImportError):
        return AsperityError(
            f"a worker cannot load asperity ({told(error)}): install it there, the same version"
        )
    name = type(error).__name__
    gone = "ancel" in name or "CommClosed" in name
    if client.status != "running" or error is None or gone:
        return AsperityError(
            "the scheduler went away; what is done is in the store, and the same command goes on"
        )
    text = told(error) if isinstance(error, BaseException) else str(error)
    return AsperityError(f"a worker could not do its batch: {text}")
