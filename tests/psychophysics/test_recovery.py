"""A simulated participant's threshold is within its interval as often as the interval says."""

import numpy as np
import pytest
from fakes import CHOICE, design
from scipy.stats import binom

from asperity.psychophysics.analysis.psychometric import FUNCTIONS
from asperity.psychophysics.analysis.psychometric_fit import fit_psychometric
from asperity.psychophysics.interfaces.protocol import SimulatedInterface
from asperity.psychophysics.procedures.procedures import procedure

STAIRS = {"start": [0.8, 0.8], "steps": [2.0, 1.41, 1.19], "trials": 75, "reversals": 1000}
DESIGNS = {
    "staircase": {"staircase": STAIRS},
    "weighted": {"staircase": {**STAIRS, "down": 1, "up_ratio": 3.0}},
    "quest+": {"forced_choice": {"adaptive": "quest+"}, "staircase": None,
               "quest": {"trials": 150}},
    "constant": {"forced_choice": {"adaptive": "constant"}, "staircase": None,
                 "constant": {"levels": [0.05, 0.1, 0.2, 0.4, 0.8], "repeats": 30}},
}  # fmt: skip


def covered(made, participant, samples=20):
    """Return whether the interval of a session has the true threshold in it, and the error."""
    steps, front = procedure(made, participant, 1), SimulatedInterface(made, participant)
    x, right = [], []
    while (trial := steps.next()) is not None:
        answer = front.ask(trial, []).answer
        steps.answer(trial, answer)
        x.append(trial.intensity)
        right.append(trial.is_right(answer))
    truth = np.log10(made.simulated.threshold)
    fit = fit_psychometric(
        x, right, function=made.simulated.function, samples=samples, quantities=("threshold",)
    )
    return fit.threshold.low <= truth <= fit.threshold.high, fit.function.threshold - truth


def fewest(sessions):
    """Return how many of so many intervals of 95 % hold the truth, but for one time in 1000."""
    return binom.ppf(0.001, sessions, 0.95)


@pytest.mark.parametrize("name", DESIGNS)
def test_two_dozen(name):
    found = [covered(design(CHOICE, **DESIGNS[name]), f"P{i}") for i in range(24)]
    assert sum(inside for inside, _ in found) >= fewest(24)
    assert all(abs(error) < 0.3 for _, error in found)


@pytest.mark.slow
@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("name", DESIGNS)
def test_many(name, function):
    sessions = 200
    made = design(CHOICE, **DESIGNS[name], simulated={"function": function})
    found = [covered(made, f"P{i}") for i in range(sessions)]
    inside = sum(inside for inside, _ in found)
    errors = np.array([error for _, error in found])
    print(f"{name}, {function}: {100 * inside / sessions:.1f} % inside, "
          f"bias {errors.mean():+.3f}, SD {errors.std():.3f} decades")  # fmt: skip
    assert inside >= fewest(sessions)
    assert abs(errors.mean()) < 0.05
