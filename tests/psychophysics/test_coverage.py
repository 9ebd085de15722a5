"""The table of docs/experiments.md: how often intervals of sessions have the truth in them.

pytest -m slow -s tests/psychophysics/test_coverage.py
"""

import os

import numpy as np
import pytest
from fakes import CHOICE, design
from scipy.stats import binom

from asperity.psychophysics.analysis.psychometric import Psychometric
from asperity.psychophysics.analysis.psychometric_fit import fall_of
from asperity.psychophysics.analysis.psychometric_search import QUANTITIES, LikelihoodSearch
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


PROPORTION = 0.8


def inside_and_error(made, participant):
    """Return whether the interval of each quantity has the true one in it, and all errors."""
    x, hits = simulated_answers(made, participant)
    levels, inverse = np.unique(x, return_inverse=True)
    count = np.bincount(inverse).astype(float)
    hit = np.bincount(inverse, weights=np.array(hits, dtype=float))
    guess, own = made.forced_choice.guess, made.simulated
    truth = Psychometric(np.log10(own.threshold), own.width, own.lapse, guess)
    search = LikelihoodSearch(levels, count, guess, "weibull", None, PROPORTION)
    best = search.best(hit[None, :])
    true = np.array([[truth.threshold, truth.width, truth.lapse]])
    top, inside, errors = search.likelihood(hit, best)[0], [], []
    for quantity in QUANTITIES:
        # The truth is inside if the profile there has not fallen too far: no need to look for ends.
        value = search.of(quantity, true)
        fall = top - search.profile(hit, quantity, value)[0]
        inside.append(fall < fall_of(0.95, made.forced_choice.adaptive, quantity))
        errors.append(search.of(quantity, best)[0] - value[0])
    return inside, errors


def coverage(name, truth, sessions):
    """Return the part of sessions whose interval has the truth in it, and the mean error."""
    made = design(
        CHOICE, **DESIGNS[name], simulated=dict(zip(("threshold", "width", "lapse"), truth,
                                                    strict=True)),
    )  # fmt: skip
    found = [inside_and_error(made, f"C{i}") for i in range(sessions)]
    inside, errors = (np.mean(part, axis=0) for part in zip(*found, strict=True))
    return (dict(zip(QUANTITIES, part, strict=True)) for part in (inside, errors))


@pytest.mark.slow
@pytest.mark.parametrize("truth", TRUTHS)
@pytest.mark.parametrize("name", DESIGNS)
def test_of_every_default_design(name, truth):
    inside, errors = coverage(name, truth, SESSIONS)
    percent = 100.0 * (10.0 ** errors["threshold"] - 1.0)
    numbers = " | ".join(f"{100.0 * part:.1f}" for part in inside.values())
    print(f"| {name} | {', '.join(map(str, truth))} | {numbers} | {percent:+.1f} |")
    lower, upper = binom.ppf([0.001, 0.999], SESSIONS, [0.93, 0.97]) / SESSIONS
    for quantity, part in inside.items():
        assert part >= lower, quantity
        # Steepness of few levels and lapses of few trials take few values: their intervals may be
        # too wide, as those of a proportion are.
        if quantity != "lapse" and (name != "constant" or quantity not in ("width", "slope")):
            assert part <= upper, quantity
    assert abs(percent) < 3.0


def test_of_a_few_sessions():
    inside, errors = coverage("constant", TRUTHS[0], 40)
    assert min(inside.values()) >= binom.ppf(0.001, 40, 0.93) / 40
    assert abs(errors["threshold"]) < 0.05


def test_what_is_expected_of_a_design_narrows_with_its_trials():
    widths = []
    for repeats in (10, 60):
        made = design(CHOICE, **(DESIGNS["constant"] | {
            "constant": {"levels": [0.05, 0.1, 0.2, 0.4, 0.8], "repeats": repeats}}))  # fmt: skip
        low, high = expected_interval(made, sessions=4)
        assert low < made.simulated.threshold < high
        widths.append(high / low)
    assert widths[1] < widths[0]
