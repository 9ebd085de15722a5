"""The table of docs/experiments.md: how often intervals of the threshold hold the truth.

pytest -m slow -s tests/psychophysics/test_coverage.py
"""

import os

import numpy as np
import pytest
from fakes import CHOICE, design
from scipy.stats import binom

from asperity.psychophysics.analysis.psychometric_fit import fall_of
from asperity.psychophysics.analysis.psychometric_search import THRESHOLD, LikelihoodSearch
from asperity.psychophysics.expected import expected_interval, simulated_answers

SESSIONS = int(os.environ.get("ASPERITY_SESSIONS", "1000"))
DESIGNS = {
    "staircase": {"staircase": {"start": [0.8, 0.8], "trials": 80}},
    "quest+": {"forced_choice": {"adaptive": "quest+"}, "staircase": None, "quest": {}},
    "constant": {"forced_choice": {"adaptive": "constant"}, "staircase": None,
                 "constant": {"levels": [0.05, 0.1, 0.2, 0.4, 0.8]}},
}  # fmt: skip
TRUTHS = [
    (0.2, 0.6, 0.02), (0.1, 0.6, 0.02), (0.3, 0.6, 0.02), (0.2, 0.4, 0.02), (0.2, 0.9, 0.02),
    (0.2, 0.6, 0.0),
]  # fmt: skip
"""Threshold, width, lapse."""


def inside_and_error(made, participant):
    """Return whether the interval of a session holds the true threshold, and the error."""
    x, hits = simulated_answers(made, participant)
    levels, inverse = np.unique(x, return_inverse=True)
    count = np.bincount(inverse).astype(float)
    hit = np.bincount(inverse, weights=np.array(hits, dtype=float))
    search = LikelihoodSearch(levels, count, made.forced_choice.guess, "weibull", None)
    best = search.best(hit[None, :])[0]
    truth = np.log10(made.simulated.threshold)
    # The truth is inside if the profile there has not fallen too far: no need to look for ends.
    profile = search.profile(hit, THRESHOLD, np.array([truth]))
    fall = search.likelihood(hit, best[None, :])[0] - profile[0]
    return fall < fall_of(0.95, made.forced_choice.adaptive), best[0] - truth


def coverage(name, truth, sessions):
    made = design(
        CHOICE, **DESIGNS[name], simulated=dict(zip(("threshold", "width", "lapse"), truth,
                                                    strict=True)),
    )  # fmt: skip
    found = [inside_and_error(made, f"C{i}") for i in range(sessions)]
    return np.mean([inside for inside, _ in found]), np.mean([error for _, error in found])


@pytest.mark.slow
@pytest.mark.parametrize("truth", TRUTHS)
@pytest.mark.parametrize("name", DESIGNS)
def test_of_every_default_design(name, truth):
    inside, bias = coverage(name, truth, SESSIONS)
    percent = 100.0 * (10.0**bias - 1.0)
    print(f"| {name} | {truth} | {100.0 * inside:.1f} % | {percent:+.1f} % |")
    lower, upper = binom.ppf([0.001, 0.999], SESSIONS, [0.93, 0.97]) / SESSIONS
    assert lower <= inside <= upper
    assert abs(percent) < 3.0


def test_of_a_few_sessions():
    inside, bias = coverage("constant", TRUTHS[0], 40)
    assert inside >= binom.ppf(0.001, 40, 0.93) / 40
    assert abs(bias) < 0.05


def test_what_is_expected_of_a_design_narrows_with_its_trials():
    widths = []
    for repeats in (10, 60):
        made = design(CHOICE, **(DESIGNS["constant"] | {
            "constant": {"levels": [0.05, 0.1, 0.2, 0.4, 0.8], "repeats": repeats}}))  # fmt: skip
        low, high = expected_interval(made, sessions=4)
        assert low < made.simulated.threshold < high
        widths.append(high / low)
    assert widths[1] < widths[0]
