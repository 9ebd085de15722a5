"""`asperity sweep`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from asperity.cli.options import Range, command, in_si, with_options
from asperity.cli.result import print_result

if TYPE_CHECKING:
    from asperity.studies.sweeps.run import SweepProgress
    from asperity.studies.sweeps.study import SweepStudy


@command
@dataclass
class SweepCommand:
    """Run every combination of a parameter sweep, on all cores or on a Dask cluster.

    Results are written to one Zarr store as they are computed. The same command resumes a sweep
    that was interrupted. `asperity plot` draws the store.
    """

    study: Annotated[Positional[Path], arg(metavar="STUDY.toml")]
    """Fixed parameters, varied parameters and stored metrics; see the documentation, Sweeps."""
    out: Path | None = None
    """The Zarr store. Default: out/sweep/STUDY.zarr."""
    workers: Annotated[int | None, Range(0, 4096)] = None
    """Number of local processes; 0: in this process, without Dask. Default: one for each core."""
    scheduler: str | None = None
    """Address of a Dask scheduler, tcp://HOST:PORT, instead of local processes."""
    check: bool = False
    """Check the study and print what it would run, without running it."""
    retry_failed: bool = False
    """Run again the combinations that failed before."""
    any_version: bool = False
    """Resume a store that was begun with another version of asperity or of its packages."""
    extend: bool = False
    """Take over what the store of a study with other values, or other numbers under keep, has of
    this one."""
    limit_s: Annotated[float | None, Range(1e-3, 1e6, "s")] = None
    """Longest time of one combination; one that takes longer fails."""
    overwrite: bool = False
    """Delete the existing store and begin again."""

    def run(self) -> None:
        """Check, run, and print how many combinations were computed."""
        from asperity.studies.sweeps.study import read_study

        study = read_study(self.study)
        if self.check:
            print_result(f"{self.study}: {_described(study)}", _facts(study))
            return
        from asperity.cli.progress import progress_bars
        from asperity.studies.sweeps.run import run_sweep

        out = self.out or Path("out/sweep") / f"{self.study.stem}.zarr"
        latest: SweepProgress | None = None
        options = in_si(self)
        with progress_bars(remaining=True) as bars:
            task: Any = None

            def show(now: SweepProgress) -> None:
                nonlocal latest, task
                latest, known = now, now.done + now.failed
                label = now.note or (f"{now.failed} failed" if now.failed else study.title)
                if task is None or (now.note and not known):
                    if task is not None:
                        bars.remove_task(task)
                    task = bars.add_task(label, total=now.total, completed=known)
                bars.update(task, completed=known, description=label)

            try:
                done = with_options(run_sweep, options, study=study, store=out, progress=show)
            except KeyboardInterrupt:
                if latest is None:
                    raise
                raise KeyboardInterrupt(
                    f"{latest.done + latest.failed} of {latest.total} combinations are in {out}; "
                    "the same command resumes"
                ) from None
        rate = f", {done.computed / done.seconds:.3g} a second" if done.computed else ""
        before = done.total - done.computed
        lines = [
            f"{out}: {done.total} combinations, {done.done} done, {done.failed} failed; "
            f"{done.computed} computed now in {done.seconds:.1f} s{rate}"
            + (f", {before} earlier" if before else "")
        ]
        if done.failed:
            lines.append(f"  first failure: {done.first_error}")
        print_result(lines, done._asdict())


def _facts(study: SweepStudy) -> dict[str, Any]:
    """Return what a study would run."""
    axes = [
        {"name": axis.name, "size": axis.size, "columns": list(axis.columns)}
        for axis in study.design.axes
    ]
    return {
        "title": study.title, "kind": study.kind, "combinations": study.size, "axes": axes,
        "stores": list(study.keep), "largest_block": study.block,
    }  # fmt: skip


def _described(study: SweepStudy) -> str:
    """Return in one line what a study would run."""
    axes = ", ".join(
        f"{axis.size} of {axis.name}"
        + (f" ({', '.join(axis.columns)})" if list(axis.columns) != [axis.name] else "")
        for axis in study.design.axes
    )
    return (
        f"{study.size} combinations of kind {study.kind}: {axes}; stores {', '.join(study.keep)}; "
        f"at most {study.block} in a block"
    )
