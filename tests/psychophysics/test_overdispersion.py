"""Overdispersion: answers that scatter more than independent ones."""

import numpy as np
import pytest
from scipy.stats import binom

from asperity.psychophysics.analysis.overdispersion import overdispersion
from asperity.psychophysics.analysis.psychometric import Psychometric
from asperity.psychophysics.analysis.psychometric_fit import fit_psychometric

TRUTH = Psychometric(0.0, 1.2, 0.02)
X = np.linspace(-0.9, 0.9, 8)


def answers(rng, rho, count=40):
    """Return trials whose probability at each level is drawn from a beta distribution."""
    p = TRUTH(X)
    if rho > 0.0:
        p = rng.beta(p * (1.0 / rho - 1.0), (1.0 - p) * (1.0 / rho - 1.0))
    hits = rng.binomial(count, p)
    return np.repeat(X, count), np.concatenate([np.arange(count) < k for k in hits])


@pytest.mark.parametrize("rho", [0.0, 0.05, 0.15])
def test_the_interval_has_the_truth_in_it(rho):
    rng, inside, middle = np.random.default_rng(5), 0, []
    for _ in range(150):
        x, right = answers(rng, rho)
        fit = fit_psychometric(x, right, samples=1, quantities=())
        value, low, high = overdispersion(x, right, fit.function)
        inside += low <= rho <= high
        middle.append(value)
    assert inside >= binom.ppf(0.001, 150, 0.92)
    assert np.median(middle) == pytest.approx(rho, abs=0.02 + 0.4 * rho)


@pytest.mark.parametrize(("corrected", "lower", "upper"), [(False, 0.0, 0.85), (True, 0.91, 0.99)])
@pytest.mark.parametrize("runs", [50, pytest.param(120, marks=pytest.mark.slow)])
def test_corrected_intervals_have_the_threshold_in_them(runs, corrected, lower, upper):
    rng, inside = np.random.default_rng(6), 0
    for _ in range(runs):
        x, right = answers(rng, 0.08)
        plain = fit_psychometric(x, right, samples=1, quantities=())
        rho = overdispersion(x, right, plain.function)[0] if corrected else 0.0
        fit = fit_psychometric(
            x, right, samples=1, quantities=("threshold",), rho=rho, adaptive="constant"
        )
        inside += fit.threshold.low < TRUTH.threshold < fit.threshold.high
    assert binom.ppf(0.001, runs, lower) <= inside <= binom.ppf(0.999, runs, upper)


def test_few_answers_a_level_say_nothing():
    x = np.repeat(X, 5)
    right = np.random.default_rng(1).random(x.size) < TRUTH(x)
    assert overdispersion(x, right, TRUTH) is None
