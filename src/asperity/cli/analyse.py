"""`asperity analyse`."""

from __future__ import annotations

from collections.abc import Iterator
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


def _lines(out: Path, found: dict[str, Any], analyses: dict[str, Any]) -> Iterator[str]:
    """Return the main numbers of one or several analyses, a line each."""
    for name, analysis in analyses.items():
        count = len(analysis["sessions"])
        yield f"{name}: {analysis['method']}, {count} session{'s' if count > 1 else ''}"
        yield from (f"  {line}" for line in _main_numbers(analysis))
        yield from (f"  {line}" for line in _means(analysis))
    for measure, compared in found.get("comparisons", {}).items():
        for one in compared:
            kind = "ratio" if "ratio" in one else "difference"
            value, size = one[kind], one["cohens_dz"]
            t = "infinite" if one["t"] is None else f"{one['t']:.2f}"
            holm = f", {one['p_holm']:.3g} after Holm" if len(compared) > 1 else ""
            yield (
                f"{one['second']} against {one['first']}, {_name(measure)}: {kind} "
                f"{_span(value)}, t({one['degrees_of_freedom']}) = {t}, "
                f"p = {one['p']:.3g}{holm}, d_z = {_span(size)}, {one['people']} people"
            )
        if not compared:
            yield f"{measure}: fewer than two people took part in two conditions"
    yield from found.get("notes", ())
    yield f"{out}: tables, figures, methods.md"


def _name(measure: str) -> str:
    names = {
        "pse": "PSE", "jnd": "JND", "d_prime": "d'", "level_at_1": "level of d' = 1",
        "at_proportion": "level at --proportion",
    }  # fmt: skip
    return names.get(measure, measure)


def _span(numbers: dict[str, Any]) -> str:
    if numbers["value"] is None:
        return "infinite"
    if numbers["low"] is None:
        return f"{numbers['value']:.3g}"
    return f"{numbers['value']:.3g} ({numbers['low']:.3g} to {numbers['high']:.3g})"


def _means(analysis: dict[str, Any]) -> Iterator[str]:
    """Return the means over participants, a line each."""
    for measure, one in analysis["group"].items():
        count = len(one["participants"])
        if count > 1 and measure != "exponent":  # it is the slope over people above
            kind = "geometric mean" if one["geometric"] else "mean"
            yield f"{kind} {_name(measure)} of {count} people: {_span(one['mean'])}"


def _main_numbers(analysis: dict[str, Any]) -> list[str]:
    """Return the main numbers of an analysis, a line each."""
    from asperity.psychophysics.analysis.adjustments import adjustment_lines
    from asperity.psychophysics.analysis.catch_trials import catch_lines
    from asperity.psychophysics.analysis.detection import detection_lines

    lines = [
        f"{session['name']}: not complete, {session['answers']} answers"
        for session in analysis["sessions"]
        if not session["complete"]
    ]
    machines = [session["name"] for session in analysis["sessions"] if session["simulated"]]
    if machines:
        lines.append(f"{', '.join(machines)}: a machine answered (--simulate), no person")
    for one in (*analysis.get("forced-choice", ()), *analysis.get("odd-one-out", ())):
        fit = one.get("psychometric")
        if fit is None:
            lines.append(f"{one['session']}: {one['not_fitted']}")
            continue
        more = fit["overdispersion_low"] or 0.0
        scatter = f"; overdispersed ({fit['overdispersion']:.2g})" if more > 0.0 else ""
        doubt = "; AT THE LIMIT OF THE SEARCH: no threshold found" if fit["at_bound"] else ""
        weber = fit.get("weber_fraction")
        share = f", {100.0 * weber:.3g} % of the standard" if weber is not None else ""
        lines.append(
            f"{one['session']}: threshold {fit['threshold']:.4g} "
            f"({fit['threshold_low']:.4g} to {fit['threshold_high']:.4g}){share}, "
            f"{one['trials']} trials, deviance p {fit['deviance_p']:.2g}{scatter}{doubt}"
        )
    lines += detection_lines(analysis.get("yes-no", ()))
    for method in ("adjustment", "matching"):
        lines += adjustment_lines(analysis.get(method, ()))
    lines += catch_lines(analysis["catch"])
    if "magnitude" in analysis:
        quadratic, power = analysis["magnitude"]["quadratic"], analysis["magnitude"]["power_law"]
        if power:
            lines.append(
                f"slope in log-log {power['slope']:.3g} ({power['low']:.3g} to {power['high']:.3g})"
            )
        if quadratic:
            # A peak without an interval is that of noise, or far beyond what was presented.
            peak = (
                f", peak at {quadratic['peak']:.4g} ({quadratic['peak_low']:.4g} to "
                f"{quadratic['peak_high']:.4g})"
                if quadratic["peak_low"] is not None
                else ", no definite peak"
            )
            lines.append(f"quadratic: R² {quadratic['r_squared']:.3f}{peak}")
    for method in ("pairs", "ranking"):
        if method in analysis:
            scale = analysis[method]["scales"][0]
            ranked = sorted(zip(scale["values"], analysis[method]["stimuli"], strict=True))[::-1]
            lines.append("largest first: " + ", ".join(f"{name} ({v:.2f})" for v, name in ranked))
    return lines
