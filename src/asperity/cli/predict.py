"""`asperity predict`, and `asperity analyse` on tables from elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from asperity.cli.options import Range, command
from asperity.cli.result import print_result
from asperity.errors import AsperityError

if TYPE_CHECKING:
    from asperity.psychophysics.outside.answers import Answers


@command
@dataclass
class PredictCommand:
    """Put a model beside people's answers: likelihood, correlation, and the raters' ceiling.

    The answers are a table, as for `asperity analyse`. Writes prediction.json and a figure.
    """

    answers: Annotated[Positional[Path], arg(metavar="ANSWERS")]
    """Table of answers: CSV or XLSX."""
    more: tuple[Path, ...] = ()
    """Further tables of the same form, such as one a person."""
    model: Path | None = None
    """Table with the model's value of each stimulus: columns stimulus, value, and perhaps
    condition."""
    stimuli: Path | None = None
    """Table of stimuli to simulate instead: columns stimulus, surface (dots, gratings, sinusoid),
    spacing_mm, and perhaps condition, height_mm, probe_mm, force_n, speed_mm_s."""
    metric: str = "band_rms"
    """Metric of the simulation: max_acceleration, max_abs_acceleration, band_rms, threshold_power,
    fa1, fa2, sa1, pooled; the last four also with _through_tissue."""
    columns: tuple[str, ...] = ()
    """name=column for columns of other names, such as rating=Roughness."""
    where: tuple[str, ...] = ()
    """column=value: keep these rows alone."""
    seed: Annotated[int, Range(0, 2**31 - 1)] = 0
    """Seed of the splits of raters."""
    out: Path | None = None
    """Folder for the results. Default: beside the answers, ending in .prediction."""
    overwrite: bool = False
    """Replace earlier results."""

    def run(self) -> None:
        """Compare, write, and print the main numbers."""
        from asperity._core.output import result_folder, write_json
        from asperity.drawing import figure_style
        from asperity.psychophysics.outside.figures import comparison_figure
        from asperity.psychophysics.outside.models import read_model, simulate_model
        from asperity.psychophysics.outside.predictions import compare_model
        from asperity.psychophysics.outside.reading import read_answers

        if (self.model is None) == (self.stimuli is None):
            raise AsperityError("give --model, or --stimuli to simulate, and not both")
        answers = read_answers((self.answers, *self.more), columns=self.columns, where=self.where)
        if self.stimuli is not None:
            values = simulate_model(self.stimuli, self.metric)
        else:
            assert self.model is not None
            values = read_model(self.model)
        found = compare_model(answers, values, seed=self.seed)
        label = self.metric if self.stimuli else self.model.stem if self.model else ""
        found |= {"read": answers.described(), "notes": list(answers.notes), "model_name": label}
        out = self.out or self.answers.with_suffix(".prediction")
        with result_folder(out, overwrite=self.overwrite) as folder:
            write_json(folder / "prediction.json", found)
            figure_style.save(comparison_figure(found), folder, "prediction")
        print_result("\n".join([f"{out}: {answers.described()}", *_lines(answers, found)]),
                     {"out": out} | found)  # fmt: skip


def _lines(answers: Answers, found: dict[str, Any]) -> list[str]:
    from asperity.drawing.pages import render

    return render("prediction_lines.txt", notes=answers.notes, found=found).splitlines()


def analyse_table(
    files: tuple[Path, ...], columns: tuple[str, ...], where: tuple[str, ...], out: Path | None,
    *, samples: int, confidence: float, seed: int, overwrite: bool,
) -> None:  # fmt: skip
    """Analyse tables from elsewhere: write means or a scale and a figure, print what was read."""
    from asperity._core.output import result_folder
    from asperity.psychophysics.outside.reading import read_answers
    from asperity.psychophysics.outside.summary import summarise_answers, write_summary

    answers = read_answers(files, columns=columns, where=where)
    out = out or files[0].with_suffix(".analysis")
    summary = summarise_answers(answers, samples=samples, confidence=confidence, seed=seed)
    with result_folder(out, overwrite=overwrite) as folder:
        write_summary(answers, summary, folder)
    lines = [f"{out}: {answers.form}, {answers.described()}"]
    lines += [f"  {note}" for note in answers.notes]
    found = summary.get("reliability")
    if found and found["reliability"] is not None:
        lines.append(
            f"  reliability of the mean over {found['raters']} raters "
            f"{found['reliability']:.2f}, a rater with the others {found['agreement']:.2f}"
        )
    print_result("\n".join(lines), {"out": out} | summary)
