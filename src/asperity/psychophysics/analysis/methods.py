"""The paragraph of methods of a paper, made from the design, the sessions and the analysis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from asperity import __version__
from asperity._core.data import table_beside
from asperity.drawing.pages import render
from asperity.psychophysics.analysis.figures import value_axis
from asperity.psychophysics.analysis.psychometric_fit import stretch_of
from asperity.psychophysics.analysis.psychometric_search import HIGHEST_LAPSE
from asperity.psychophysics.settings import (
    ForcedChoiceSettings,
)

if TYPE_CHECKING:
    from asperity.psychophysics.analysis.results import SessionResult
    from asperity.psychophysics.analysis.thresholds import AnalysisOptions
    from asperity.psychophysics.design import ExperimentDesign

REFERENCES: dict[str, str] = table_beside(__file__, "references.toml")
"""What a text may cite -> its entry in the list of references."""
_WORDS = {1: "one", 2: "two", 3: "three"}
_NAMES = {"weibull": "Weibull", "logistic": "logistic", "normal": "cumulative normal"}


def methods_text(
    designs: Mapping[str, ExperimentDesign],
    results: Sequence[SessionResult],
    options: AnalysisOptions,
) -> str:
    """Return the methods as Markdown: participants, procedure, analysis, references.

    Parameters
    ----------
    designs : mapping of ExperimentDesign by condition
    results : sequence of SessionResult
        Of all conditions.
    options : AnalysisOptions
    """
    people = len({result.participant for result in results})
    parts = [_text("participants", people=people, results=results, names=tuple(designs))]
    texts: dict[str, list[str]] = {}
    for name, design in designs.items():
        texts.setdefault(_procedure(design), []).append(name)
    for text, names in texts.items():
        parts.append(text if len(texts) == 1 else f"*{', '.join(names)}.* {text}")
    first = next(iter(designs.values()))
    parts.append(_analysis(first, options, people, len(designs)))
    text = "\n\n".join(parts)
    cited = [entry for key, entry in sorted(REFERENCES.items()) if key in text]
    return f"{text}\n\n## References\n\n" + "\n".join(f"- {entry}" for entry in cited) + "\n"


def _text(part: str, **values: Any) -> str:
    """Return a part of the template, its lines joined."""
    text = render("experiment_methods.md", part=part, version=__version__, **values)
    return " ".join(line.strip() for line in text.splitlines() if line.strip())


def _procedure(design: ExperimentDesign) -> str:
    stimuli, (factor, axis) = len(design.all_stimuli()), value_axis(design)
    count = {"magnitude": 1, "yes-no": 1, "ranking": stimuli}.get(
        design.method, getattr(design.settings, "intervals", 2)
    )
    label, _, unit = axis.partition(" [")
    standard = getattr(design.settings, "standard", 0.0) * factor
    return _text(
        "procedure", design=design, stimuli=stimuli, count=count, words=_WORDS, label=label,
        standard=f"{standard:.4g} {unit.rstrip(']')}".strip(),
        listed=lambda values: ", ".join(f"{value:g}" for value in values),
    )  # fmt: skip


def _analysis(
    design: ExperimentDesign, options: AnalysisOptions, people: int, conditions: int
) -> str:
    stretch = 1.0
    if isinstance(design.settings, ForcedChoiceSettings):
        chosen = design.settings
        stretch = stretch_of(chosen.adaptive, chosen.guess)["threshold"]
    return _text(
        "analysis", design=design, options=options, people=people, conditions=conditions,
        functions=_NAMES, highest_lapse=HIGHEST_LAPSE, stretch=stretch,
    )  # fmt: skip
