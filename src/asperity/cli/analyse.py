"""`asperity analyse`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, arg

from asperity.cli.options import Range, command, with_options
from asperity.cli.result import print_result
from asperity.errors import AsperityError, require_choice


@command
@dataclass
class AnalyseCommand:
    """Analyse the sessions of an experiment: thresholds, magnitudes or scales, with figures.

    Several folders are conditions, which are compared within participants. Writes analysis.json or
    comparison.json, answers.csv, thresholds.csv, methods.md and the figures. Tables of answers from
    elsewhere (CSV, XLSX) are analysed too: magnitude estimates, choices of two, or rankings.
    """

    folders: Annotated[Positional[tuple[Path, ...]], arg(metavar="FOLDER [FOLDER ...]")]
    """Folder of a session, or one that contains folders of sessions; one for each condition. Or
    tables of answers, all of one form."""
    columns: tuple[str, ...] = ()
    """For tables: name=column for columns of other names. Names: participant, stimulus, rating;
    first, second, chosen; trial, rank; and condition, more than once if need be."""
    where: tuple[str, ...] = ()
    """For tables: column=value: keep these rows alone."""
    function: str = "weibull"
    """Psychometric function: logistic, normal, weibull."""
    samples: Annotated[int, Range(100, 100000)] = 1000
    """Number of bootstrap samples, for the intervals of scales and the deviance of psychometric
    functions."""
    confidence: Annotated[float, Range(0.5, 0.999)] = 0.95
    """Confidence level of the intervals."""
    proportion: Annotated[float | None, Range(0.01, 0.999)] = None
    """Also find the level at which this proportion of answers is right, such as 0.8."""
    overdispersed: bool = False
    """Correct estimates and intervals for answers that scatter more than independent ones."""
    seed: Annotated[int, Range(0, 2**31 - 1)] = 0
    """Seed of the bootstrap."""
    out: Path | None = None
    """Folder for the results. Default: FOLDER/analysis, or comparison beside the first FOLDER; of
    tables, beside the first."""
    overwrite: bool = False
    """Replace an earlier analysis."""

    def run(self) -> None:
        """Analyse, write, and print the main numbers."""
        from asperity._core.output import result_folder
        from asperity.cli.progress import progress_bars
        from asperity.psychophysics.analysis.analysis import analyse, analyse_conditions
        from asperity.psychophysics.analysis.psychometric import FUNCTIONS
        from asperity.psychophysics.analysis.results import read_conditions
        from asperity.psychophysics.analysis.thresholds import AnalysisOptions

        if not self.folders:
            raise AsperityError("give the folder of a session, or of several")
        if all(path.is_file() for path in self.folders):
            from asperity.cli.predict import analyse_table

            analyse_table(
                self.folders, self.columns, self.where, self.out,
                samples=self.samples, confidence=self.confidence, seed=self.seed,
                overwrite=self.overwrite,
            )  # fmt: skip
            return
        if self.columns or self.where:
            raise AsperityError(
                f"--columns and --where are for tables, and {self.folders[0]} is no file"
            )
        require_choice("--function", self.function, FUNCTIONS)
        conditions = read_conditions(self.folders)
        options = with_options(AnalysisOptions, self)
        first, several = self.folders[0], len(self.folders) > 1
        out = self.out or (first.resolve().parent / "comparison" if several else first / "analysis")
        count = sum(len(results) for results in conditions.values())
        with result_folder(out, overwrite=self.overwrite) as folder, progress_bars() as bars:
            task = bars.add_task("analysis", total=count, completed=-1)

            def show(session: str) -> None:
                bars.update(task, description=session, advance=1)

            if several:
                found = analyse_conditions(conditions, folder, options, show)
                analyses = found["conditions"]
            else:
                found = analyse(next(iter(conditions.values())), folder, options, show)
                analyses = {next(iter(conditions)): found}
        print_result(_lines(out, found, analyses), found)


def _lines(out: Path, found: dict[str, Any], analyses: dict[str, Any]) -> list[str]:
    """Return the main numbers of one or several analyses, a line each."""
    from asperity.drawing.pages import render
    from asperity.psychophysics.analysis.results import ENOUGH

    def ranked(values: list[float], names: list[str]) -> list[tuple[float, str]]:
        return sorted(zip(values, names, strict=True))[::-1]

    text = render(
        "analysis_lines.txt", out=out, found=found, analyses=analyses, enough=ENOUGH, ranked=ranked
    )
    return text.splitlines()
