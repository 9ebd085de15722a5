"""`asperity sweep`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from asperity.cli.ranges import Between, check_ranges

if TYPE_CHECKING:
    from asperity.studies.sweeps.run import SweepProgress
    from asperity.studies.sweeps.study import SweepStudy


@dataclass
class SweepCommand:
    """Run every combination of a large study, on all cores or on a Dask cluster.

    Results go into one Zarr store as they come. A sweep that was stopped, however, goes on with
    the same command. `asperity plot` draws the store.
    """

    study: Annotated[Positional[Path], arg(metavar="STUDY.toml")]
    """What stays, what varies, what is kept; see the documentation, Large studies."""
    out: Path | None = None
    """The store. Default: out/sweep/STUDY.zarr."""
    workers: Annotated[int | None, Between(0, 4096)] = None
    """Local processes. Default: one for each core. 0: in this process, without Dask."""
    scheduler: str | None = None
    """Address of a Dask scheduler, tcp://HOST:PORT, instead of local processes."""
    check: bool = False
    """Check the study, say what it would run, and stop."""
    retry_failed: bool = False
    """Run combinations again that failed before."""
    any_version: bool = False
    """Go on with a store that another version of asperity, or of its packages, began."""
    overwrite: bool = False
    """Begin anew."""

    def run(self) -> None:
        """Check, run, and say what came of it."""
        check_ranges(self)
        from asperity.studies.sweeps.study import read_study

        study = read_study(self.study)
        if self.check:
            print(f"{self.study}: {_described(study)}")
            return
        from asperity.cli.progress import progress_bars
        from asperity.studies.sweeps.run import run_sweep

        out = self.out or Path("out/sweep") / f"{self.study.stem}.zarr"
        far: SweepProgress | None = None
        with progress_bars(remaining=True) as bars:
            task: Any = None

            def show(now: SweepProgress) -> None:
                nonlocal far, task
                far, known = now, now.done + now.failed
                words = now.note or (f"{now.failed} failed" if now.failed else study.title)
                if task is None or (now.note and not known):
                    if task is not None:
                        bars.remove_task(task)
                    task = bars.add_task(words, total=now.total, completed=known)
                bars.update(task, completed=known, description=words)

            try:
                done = run_sweep(
                    study, out, workers=self.workers, scheduler=self.scheduler,
                    overwrite=self.overwrite, retry_failed=self.retry_failed,
                    any_version=self.any_version, progress=show,
                )  # fmt: skip
            except KeyboardInterrupt:
                if far is None:
                    raise
                raise KeyboardInterrupt(
                    f"{far.done + far.failed} of {far.total} are in {out}; the same command goes on"
                ) from None
        rate = f", {done.computed / done.seconds:.3g} a second" if done.computed else ""
        before = done.total - done.computed
        print(
            f"{out}: {done.total} combinations, {done.done} done, {done.failed} failed; "
            f"{done.computed} of them now, in {done.seconds:.1f} s{rate}"
            + (f", {before} before" if before else "")
        )
        if done.failed:
            print(f"  the first that failed: {done.first_error}")


def _described(study: SweepStudy) -> str:
    """Return what a study would run, in one line."""
    axes = ", ".join(
        f"{axis.size} of {axis.name}"
        + (f" ({', '.join(axis.columns)})" if list(axis.columns) != [axis.name] else "")
        for axis in study.design.axes
    )
    return (
        f"{study.size} combinations of kind {study.kind}: {axes}; keeps {', '.join(study.keep)}; "
        f"blocks of {study.block} at most"
    )
