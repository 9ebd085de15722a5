"""`asperity findings`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from asperity.cli.ranges import Between, check_ranges
from asperity.errors import AsperityError


@dataclass
class FindingsCommand:
    """Judge published findings about roughness through a probe, and say which come out.

    Prints the table. With --out, writes it as JSON, CSV and Markdown, with figures.
    """

    out: Path | None = None
    """Folder for the table, the page and the figures."""
    docs: Path | None = None
    """Folder of the documentation, for its page findings.md and images/findings_*.png."""
    fit: bool = False
    """Search for one hand and one metric first (minutes), and use them for the last column."""
    hands: Annotated[int, Between(2, 4096)] = 64
    """Of the search, a power of 2."""
    seed: Annotated[int, Between(0, 2**31 - 1)] = 0
    """Of the search and of its bootstrap."""
    spacings: Annotated[int, Between(8, 200)] = 20
    """Of each curve of the table."""
    data: Path | None = None
    """Folder of measured surfaces. Default: ../shared/data/measured, where that is present."""
    overwrite: bool = False
    """Replace what is in the folder."""

    def run(self) -> None:
        """Judge, print, and write."""
        check_ranges(self)
        import json

        from asperity._core.output import result_folder
        from asperity.cli.data_files import measured_folder
        from asperity.cli.progress import progress_bars
        from asperity.studies.literature import fit as fits
        from asperity.studies.literature.catalogue import FINDINGS
        from asperity.studies.literature.laboratory import Plan
        from asperity.studies.literature.table import columns_of, judge_all
        from asperity.studies.literature.write import print_table, write_docs, write_findings

        if self.hands & (self.hands - 1):
            raise AsperityError(f"--hands must be a power of 2, got {self.hands}")
        if self.docs and not (self.docs / "images").is_dir():
            raise AsperityError(f"{self.docs} is no folder of documentation: it has no images/")
        data = measured_folder(self.data)

        def work(folder: Path | None) -> None:
            with progress_bars() as bars:
                fit = fits.published()
                if self.fit:
                    task = bars.add_task("hands", total=self.hands + fits.OTHERS)
                    fit = fits.run_fit(
                        self.hands, seed=self.seed, progress=lambda: bars.advance(task)
                    )
                columns = columns_of(fits.chosen_of(fit))
                task = bars.add_task("findings", total=len(FINDINGS))
                rows, labs = judge_all(
                    columns,
                    plan=Plan(spacings=self.spacings),
                    data=data,
                    progress=lambda: bars.advance(task),
                )
            if folder:
                write_findings(rows, columns, labs, fit, folder)
                if self.fit:
                    text = json.dumps(fit, indent=1, allow_nan=False) + "\n"
                    (folder / "fit.json").write_text(text, "utf-8")
            if self.docs:
                write_docs(rows, columns, labs, fit, self.docs)
            print_table(rows, columns)

        if self.out is None:
            work(None)
            return
        with result_folder(self.out, overwrite=self.overwrite) as folder:
            work(folder)
        print(f"{self.out}: findings.md, findings.json, findings.csv, figures")
