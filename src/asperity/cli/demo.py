"""`asperity demo`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from asperity.cli.options import command
from asperity.cli.result import print_result


@command
@dataclass
class DemoCommand:
    """Run the studies of Otaduy & Lin (2004), real surfaces and three 6-DoF scenes; write a report.

    The report is one self-contained HTML page; figures, data and sounds are written beside it.
    """

    out: Path = Path("out")
    """Folder for report.html, with figures, data and sounds in its subfolder demo."""
    data: Path | None = None
    """Folder of measured surfaces. Default: ../shared/data/measured, if it exists; a surface that
    is not in the folder is replaced by a generated one."""
    overwrite: bool = False
    """Replace an earlier report."""

    def run(self) -> None:
        """Run everything, write the report, and print where it is."""
        import time

        start = time.perf_counter()
        from asperity._core.output import refuse_foreign_page, result_folder, write_page
        from asperity.cli.data_files import measured_folder
        from asperity.cli.demo_pipeline import run_demo, steps
        from asperity.cli.progress import progress_bars
        from asperity.cli.report import report_page
        from asperity.simulation.tool_contact import announce_compiling
        from asperity.studies.otaduy_lin_2004.claims import count_reproduced
        from asperity.studies.otaduy_lin_2004.studies import StudySettings

        page = self.out / "report.html"
        refuse_foreign_page(page, overwrite=self.overwrite)
        data, settings = measured_folder(self.data), StudySettings()
        loading = time.perf_counter() - start
        drags, rubs, ticks = steps(settings)
        announce_compiling("mesh_tick")
        with result_folder(self.out / "demo", overwrite=self.overwrite) as folder:
            with progress_bars() as bars:
                first = bars.add_task("studies", total=drags)
                # In the order in which they end: the line names the first unfinished one.
                second = bars.add_task("scenes", total=ticks)
                third = bars.add_task("surfaces", total=rubs)
                bars.add_task("figures and report", total=None)
                results = run_demo(
                    folder, data, settings=settings,
                    on_drag=lambda: bars.advance(first), on_ticks=lambda: bars.advance(second),
                    on_rub=lambda: bars.advance(third),
                )  # fmt: skip
            results.seconds = {
                "loading the libraries": loading, **results.seconds,
                "all": time.perf_counter() - start,
            }  # fmt: skip
            write_page(page, report_page(results), overwrite=self.overwrite)
        held, counted = count_reproduced(results.claims)
        print_result(
            f"{page}: {held} of {counted} claims of the paper reproduce; "
            f"took {time.perf_counter() - start:.1f} s",
            {"report": page, "claims": results.claims, "seconds": results.seconds},
        )
