"""What a design will tell: the intervals that simulated sessions lead to."""

from __future__ import annotations

import numpy as np

from asperity.psychophysics.analysis.adjustments import analyse_adjustments
from asperity.psychophysics.analysis.detection import analyse_detection
from asperity.psychophysics.analysis.psychometric_fit import Fit, fit_psychometric
from asperity.psychophysics.analysis.results import AnsweredTrial, SessionResult
from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.interfaces.protocol import SimulatedInterface
from asperity.psychophysics.procedures.procedures import procedure

SESSIONS = 12
"""Simulated sessions of which the median is expected."""


def simulated_session(design: ExperimentDesign, participant: str) -> SessionResult:
    """Return a session of the simulated participant, who judges the stimulus's parameter."""
    steps, front = procedure(design, participant, 1), SimulatedInterface(design, participant)
    answers, catch = [], []
    while (trial := steps.next()) is not None:
        answer = front.answer(trial, [])
        steps.answer(trial, answer)
        answered = AnsweredTrial(trial, answer, trial.is_right(answer), 0.0, ())
        if trial.counts:
            answers.append(answered)
        elif trial.catch:
            catch.append(answered)
    return SessionResult(
        participant, 1, design, design.digest, tuple(answers), complete=True, simulated=True,
        catch=tuple(catch),
    )  # fmt: skip


def simulated_answers(design: ExperimentDesign, participant: str) -> tuple[list[float], list[bool]]:
    """Return the intensity of each trial of a simulated session, and whether the target was hit.

    Practice and catch trials are left out.
    """
    answers = simulated_session(design, participant).answers
    return [a.trial.intensity for a in answers if a.trial.intensity is not None], [
        bool(a.hit) for a in answers if a.trial.intensity is not None
    ]


def expected_lines(design: ExperimentDesign) -> list[str]:
    """Return what is to be expected of a session, a line for each estimate; none of magnitudes."""
    note = f"(95 %, median of {SESSIONS} simulated sessions)"
    interval = expected_interval(design)
    if interval is not None:
        return [
            f"a threshold of {design.simulated.threshold:.3g} would be known to lie from "
            f"{interval[0]:.3g} to {interval[1]:.3g} {note}"
        ]
    if design.kind not in ("yes-no", "adjust") or design.simulated.rates != "parameter":
        return []
    if design.kind == "adjust" and any(one.value is None for one in design.standards()):
        return []
    results = [simulated_session(design, f"check{i + 1}") for i in range(SESSIONS)]
    lines = []
    if design.kind == "yes-no":
        sessions = analyse_detection(results, 0.95, fitted=False)
        for i, level in enumerate(sessions[0]["levels"]):
            found = _medians([one["levels"][i] for one in sessions], "d_prime")
            lines.append(
                f"at level {level['level']:.4g} a d' of {found[0]:.2f} would be known to lie from "
                f"{found[1]:.2f} to {found[2]:.2f} {note}"
            )
        return lines
    settled = analyse_adjustments(results, 0.95)
    for i, standard in enumerate(settled[0]["standards"]):
        rows = [one["standards"][i] for one in settled]
        rows = [row for row in rows if row["pse_low"] is not None]
        if rows:
            pse, jnd = _medians(rows, "pse"), _medians(rows, "jnd")
            lines.append(
                f"standard {standard['standard']}: a PSE of {pse[0]:.4g} would be known to lie "
                f"from {pse[1]:.4g} to {pse[2]:.4g}, a JND of {jnd[0]:.3g} from {jnd[1]:.3g} "
                f"to {jnd[2]:.3g} {note}"
            )
    return lines


def steps_of_adjustments(design: ExperimentDesign) -> float:
    """Return the mean steps of an adjustment in one simulated session.

    Half of the most where none can be simulated.
    """
    standards = [standard.value for standard in design.standards()]
    if design.simulated.rates != "parameter" or None in standards:
        return 0.5 * design.matching.steps
    answers = simulated_session(design, "check1").answers
    return len(answers) / max(sum(a.answer == 0 for a in answers), 1)


def _medians(rows: list[dict[str, float]], name: str) -> list[float]:
    return [
        float(np.median([row[f"{name}{end}"] for row in rows])) for end in ("", "_low", "_high")
    ]


def expected_interval(
    design: ExperimentDesign, sessions: int = SESSIONS
) -> tuple[float, float] | None:
    """Return the median ends of the 95 % interval of the threshold, as levels.

    None unless the design is a forced choice whose simulated participant judges the parameter.
    """
    if design.adaptive is None or design.simulated.rates != "parameter":
        return None
    settings, fits = design.forced_choice, list[Fit]()
    for i in range(sessions):
        x, hits = simulated_answers(design, f"check{i + 1}")
        fits.append(
            fit_psychometric(
                x, hits, guess=settings.guess, function=design.simulated.function, samples=1,
                adaptive=settings.adaptive, quantities=("threshold",),
            )
        )  # fmt: skip
    low, high = np.median([fit.threshold for fit in fits], axis=0)
    return (10.0**low, 10.0**high) if settings.scale == "log" else (float(low), float(high))
