"""`asperity findings`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from asperity.cli.options import Range, command
from asperity.cli.result import print_result, wants_json
from asperity.errors import AsperityError, require_choice


@command
@dataclass
class FindingsCommand:
    """Test the models against published findings on roughness perceived through a probe.

    Prints a table of which findings each metric reproduces. With --out, writes it as JSON, CSV and
    Markdown, with figures.
    """

    out: Path | None = None
    """Folder for the table, the page and the figures."""
    docs: Path | None = None
    """Folder of the documentation, for findings.md, findings_details.md and
    images/findings_*.png."""
    halves: bool = False
    """Choose a metric on half of the findings over 36 hands and three plates, and judge it on the
    other half (minutes): halves.json in --out."""
    parts: bool = False
    """Judge the findings over 36 hands and three plates with each part that the paper leaves out
    (minutes): parts.json in --out."""
    finger: str | None = None
    """Judge the findings about bare fingers alone, with one model of the finger: averaging (that of
    the whole table), pressed (how unevenly its skin is pressed, whatever the metric), or soft (the
    fingertip of the scene finger-plate); fingers.json in --out."""
    predictions: Path | None = None
    """Folder for predictions of conditions that are not among the findings: DATE.md and DATE.json,
    with a hash."""
    date: str = ""
    """Date of the predictions, YYYY-MM-DD. Default: today."""
    fit: bool = False
    """First search for the hand and the metric that fit best (minutes); use them in the last
    column instead of the published fit."""
    hands: Annotated[int, Range(2, 4096)] = 64
    """Number of hands that the search tries, a power of 2."""
    seed: Annotated[int, Range(0, 2**31 - 1)] = 0
    """Seed of the search and of its bootstrap."""
    spacings: Annotated[int, Range(8, 200)] = 20
    """Number of spacings on each curve."""
    data: Path | None = None
    """Folder of measured surfaces. Default: ../shared/data/measured, if it exists."""
    overwrite: bool = False
    """Replace files of the same names in the folder."""

    def run(self) -> None:
        """Judge every finding, print the table, and write it."""
        if self.finger is not None:
            self._run_fingers(self.finger)
            return
        if self.predictions or self.halves or self.parts:
            self._run_ensemble()
            return
        from asperity._core.output import result_folder, write_json
        from asperity.cli.data_files import measured_folder
        from asperity.cli.progress import progress_bars
        from asperity.studies.ensemble.parts import parts_summary, read_parts
        from asperity.studies.ensemble.parts_figures import page_figures
        from asperity.studies.literature import fit as fits
        from asperity.studies.literature.catalogue import FINDINGS
        from asperity.studies.literature.laboratory import Plan
        from asperity.studies.literature.table import document, judge_all, make_columns
        from asperity.studies.literature.write import (
            Ensemble,
            print_table,
            write_docs,
            write_findings,
        )

        if self.hands & (self.hands - 1):
            raise AsperityError(f"--hands must be a power of 2, got {self.hands}")
        if self.docs and not (self.docs / "images").is_dir():
            raise AsperityError(f"--docs {self.docs} is no folder of documentation: no images/")
        data = measured_folder(self.data)

        def judge(folder: Path | None) -> dict[str, Any]:
            with progress_bars() as bars:
                fit = fits.read_published_fit()
                if self.fit:
                    task = bars.add_task("hands", total=self.hands + fits.OTHERS)
                    fit = fits.run_fit(
                        self.hands, seed=self.seed, progress=lambda: bars.advance(task)
                    )
                columns = make_columns(fits.chosen_design(fit))
                task = bars.add_task("findings", total=len(FINDINGS))
                rows, labs = judge_all(
                    columns,
                    plan=Plan(spacings=self.spacings),
                    data=data,
                    progress=lambda: bars.advance(task),
                )
            stored = read_parts()
            ensemble = Ensemble(parts_summary(stored), page_figures(stored))
            if folder:
                write_findings(rows, columns, labs, fit, ensemble, folder)
                if self.fit:
                    write_json(folder / "fit.json", fit)
            if self.docs:
                write_docs(rows, columns, labs, fit, ensemble, self.docs)
            if not wants_json():
                print_table(rows, columns)
            return document(rows, columns)

        if self.out is None:
            print_result([], judge(None))
            return
        with result_folder(self.out, overwrite=self.overwrite) as folder:
            found = judge(folder)
        line = f"{self.out}: findings.md, findings.json, findings.csv, figures"
        print_result(line, found | {"out": self.out})

    def _run_fingers(self, finger: str) -> None:
        """Judge the findings about bare fingers with one model of the finger."""
        from asperity._core.output import result_folder, write_json
        from asperity.cli.progress import progress_bars
        from asperity.studies.literature.catalogue import of_fingers
        from asperity.studies.literature.laboratory import Plan
        from asperity.studies.literature.table import (
            FINGERS,
            count_findings,
            document,
            judge_all,
            make_columns,
        )
        from asperity.studies.literature.write import print_table

        require_choice("finger", finger, FINGERS)
        others = [name for name in ("docs", "halves", "parts", "predictions", "fit", "data")
                  if getattr(self, name)]  # fmt: skip
        if others:
            raise AsperityError(f"--finger {finger}: leave out --{', --'.join(others)}")
        columns, findings = make_columns(), of_fingers(finger)
        with progress_bars() as bars:
            task = bars.add_task(f"findings, {finger} finger", total=len(findings))
            rows, _ = judge_all(
                columns, findings=findings, plan=Plan(spacings=self.spacings), finger=finger,
                progress=lambda: bars.advance(task),
            )  # fmt: skip
        found = document(rows, columns) | {"finger": finger}
        if not wants_json():
            print_table(rows, columns)
        held = [count_findings(rows, column.name) for column in columns]
        line = f"{finger} finger: " + ", ".join(
            f"{column.name} {count} of {total}"
            for column, (count, total) in zip(columns, held, strict=True)
        )
        if self.out is None:
            print_result(line, found)
            return
        with result_folder(self.out, overwrite=self.overwrite) as folder:
            write_json(folder / "fingers.json", found)
        print_result(f"{self.out}: fingers.json; {line}", found | {"out": self.out})

    def _run_ensemble(self) -> None:
        from asperity.cli.progress import progress_bars
        from asperity.studies.ensemble.members import ensemble_hands
        from asperity.studies.ensemble.predictions import write_predictions

        for name in ("halves", "parts"):
            if getattr(self, name) and self.out is None:
                raise AsperityError(f"--{name} needs --out, the folder for {name}.json")
        total = len(ensemble_hands())
        with progress_bars() as bars:

            def task(name: str) -> Callable[[], None]:
                bar = bars.add_task(name, total=total)
                return lambda: bars.advance(bar)

            lines: list[str] = []
            facts: dict[str, Any] = {}
            if self.out and (self.halves or self.parts):
                self._write_ensemble(self.out, task, lines, facts)
            if self.predictions:
                path = write_predictions(self.predictions, self.date, progress=task("hands"))
                lines.append(f"{path}: predictions, and the same as JSON beside it")
                facts["predictions"] = path
        print_result(lines, facts)

    def _write_ensemble(
        self, out: Path, task: Callable[[str], Callable[[], None]], lines: list[str],
        facts: dict[str, Any],
    ) -> None:  # fmt: skip
        """Write halves.json and parts.json, and add what they come to to the result."""
        from asperity._core.output import result_folder, write_json
        from asperity.studies.ensemble.halves import judge_ensemble, summarise_halves
        from asperity.studies.ensemble.parts import (
            judge_parts,
            parts_document,
            parts_summary,
        )

        with result_folder(out, overwrite=self.overwrite) as folder:
            if self.halves:
                found = summarise_halves(judge_ensemble(progress=task("hands, for halves")))
                write_json(folder / "halves.json", found)
                shares = found["shares"]
                facts["halves"] = found
                lines.append(
                    f"{out}: {found['chosen']['name']}, held out: median "
                    f"{shares['chosen']['second']['median']:.0%}, 20-200 Hz band "
                    f"{shares['band']['second']['median']:.0%}"
                )
            if self.parts:
                table = judge_parts(progress=task("hands, for parts"))
                write_json(folder / "parts.json", parts_document(table))
                facts["parts"] = summary = parts_summary(table)
                medians = summary["median"]
                lines.append(
                    f"{out}: median member, 20-200 Hz band {medians['band']['all']:.0%}, with "
                    f"every part {medians['pooled_tissue_lift_skin']['all']:.0%} of the findings"
                )
