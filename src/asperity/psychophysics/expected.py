"""What a design will tell: the interval of the threshold that simulated sessions lead to."""

from __future__ import annotations

import numpy as np

from asperity.psychophysics.analysis.psychometric_fit import Fit, fit_psychometric
from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.interfaces.protocol import SimulatedInterface
from asperity.psychophysics.procedures.procedures import procedure


def simulated_answers(design: ExperimentDesign, participant: str) -> tuple[list[float], list[bool]]:
    """Return the intensity of each trial of a simulated session, and whether the target was hit.

    Practice and catch trials are left out. The participant answers by `[simulated]`, by the
    stimulus's parameter.
    """
    steps, front = procedure(design, participant, 1), SimulatedInterface(design, participant)
    intensities, hits = [], []
    while (trial := steps.next()) is not None:
        answer = front.answer(trial, [])
        steps.answer(trial, answer)
        if trial.counts and trial.intensity is not None:
            intensities.append(trial.intensity)
            hits.append(bool(trial.is_target(answer)))
    return intensities, hits


def expected_interval(design: ExperimentDesign, sessions: int = 12) -> tuple[float, float] | None:
    """Return the median ends of the 95 % interval of the threshold, as levels.

    None unless the design is a forced choice whose simulated participant judges the parameter.
    """
    if design.adaptive is None or design.simulated.rates != "parameter":
        return None
    settings, fits = design.forced_choice, list[Fit]()
    for i in range(sessions):
        x, hits = simulated_answers(design, f"check{i}")
        fits.append(
            fit_psychometric(
                x, hits, guess=settings.guess, function=design.simulated.function, samples=1,
                adaptive=settings.adaptive,
            )
        )  # fmt: skip
    low, high = np.median([fit.threshold for fit in fits], axis=0)
    return (10.0**low, 10.0**high) if settings.scale == "log" else (float(low), float(high))
