"""Psychometric functions and their fits."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import chi2

from asperity.errors import AsperityError
from asperity.psychophysics.analysis.psychometric import FUNCTIONS, Psychometric
from asperity.psychophysics.analysis.psychometric_fit import fit_psychometric
from asperity.psychophysics.analysis.psychometric_search import (
    HIGHEST_LAPSE,
    THRESHOLD,
    WIDTH,
    LikelihoodSearch,
)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_threshold_and_width_are_where_they_say(function):
    f = Psychometric(-0.5, 0.8, 0.0, 0.0, function)
    assert float(f(-0.5)) == pytest.approx(0.5)
    low, high = f.at(0.05), f.at(0.95)
    assert high - low == pytest.approx(0.8)
    for right in (0.1, 0.5, 0.9):
        assert float(f(f.at(right))) == pytest.approx(right)
    x = np.linspace(-40, 40, 999)
    assert np.all(np.diff(f(x)) >= 0.0)
    assert f(x)[0] == pytest.approx(0.0, abs=1e-12)
    assert f(x)[-1] == pytest.approx(1.0)


def test_guessing_and_lapses():
    f = Psychometric(0.0, 1.0, 0.04, 0.5, "weibull")
    assert float(f(-9.0)) == pytest.approx(0.5, abs=1e-9)
    assert float(f(9.0)) == pytest.approx(0.96)
    assert float(f(0.0)) == pytest.approx(0.73)
    assert np.isnan(f.at(0.97))
    assert np.isnan(f.at(0.5))


def test_weibull_of_the_logarithm_is_weibulls():
    f = Psychometric(np.log10(3.0), 0.5, 0.0, 0.0, "weibull")
    slope = 4.0674 / 0.5 / np.log(10.0)
    level = np.array([1.0, 2.0, 3.0, 5.0])
    expected = 1.0 - 0.5 ** ((level / 3.0) ** slope)
    np.testing.assert_allclose(f(np.log10(level)), expected, rtol=1e-4)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_the_fit_is_where_another_optimiser_finds_it(function):
    truth = Psychometric(-0.7, 0.6, 0.02, 0.5, function)
    rng = np.random.default_rng(4)
    x = np.repeat(np.linspace(-1.4, 0.0, 7), 40)
    right = rng.random(x.size) < truth(x)
    found = fit_psychometric(x, right, function=function, samples=100).function

    def cost(p):
        f = Psychometric(p[0], np.exp(p[1]), np.clip(p[2], 0.0, HIGHEST_LAPSE), 0.5, function)
        psi = np.clip(f(x), 1e-9, 1 - 1e-9)
        return -np.sum(np.where(right, np.log(psi), np.log1p(-psi)))

    other = min(
        (minimize(cost, (-0.7, np.log(w), lapse), method="Nelder-Mead",
                  bounds=((-3, 3), (-4, 3), (0.0, HIGHEST_LAPSE)))
         for w in (0.3, 0.6, 1.2) for lapse in (0.01, 0.05)),
        key=lambda result: result.fun,
    )  # fmt: skip
    mine = cost((found.threshold, np.log(found.width), found.lapse))
    assert mine <= other.fun + 1e-3
    assert found.threshold == pytest.approx(other.x[0], abs=0.01)


def test_shifting_and_stretching_the_axis_does_the_same_to_the_fit():
    rng = np.random.default_rng(7)
    x = np.repeat(np.linspace(-1, 1, 6), 30)
    right = rng.random(x.size) < Psychometric(0.1, 0.9)(x)
    one = fit_psychometric(x, right, samples=100)
    other = fit_psychometric(3.0 * x + 5.0, right, samples=100)
    assert other.function.threshold == pytest.approx(3 * one.function.threshold + 5, abs=0.02)
    assert other.function.width == pytest.approx(3 * one.function.width, rel=0.02)
    assert other.threshold.low == pytest.approx(3 * one.threshold.low + 5, abs=0.05)


def test_the_bootstrap_is_seeded_and_deviance_knows_a_bad_fit():
    x = np.repeat(np.linspace(-1, 1, 6), 40)
    right = np.random.default_rng(1).random(x.size) < Psychometric(0.0, 1.0)(x)
    one, same = (fit_psychometric(x, right, samples=200, seed=5) for _ in range(2))
    assert one == same
    assert one.deviance_p > 0.02
    # Falling: no psychometric function does that.
    falling = fit_psychometric(x, np.sort(right)[::-1], samples=200)
    assert falling.deviance_p < 0.01


def test_refuses_what_cannot_be_fitted():
    with pytest.raises(AsperityError, match="needs at least ten answers at two levels, got 3 at 1"):
        fit_psychometric([1.0, 1.0, 1.0], [True, False, True])


def test_answers_that_say_nothing_are_known():
    fit = fit_psychometric(np.repeat([0.0, 1.0, 2.0], 10), [True] * 30, samples=100)
    assert fit.at_bound


@pytest.mark.parametrize("which", [THRESHOLD, WIDTH])
@pytest.mark.parametrize("lapse", [None, 0.03])
def test_an_interval_ends_where_the_likelihood_has_fallen(which, lapse):
    """Beside an optimiser of SciPy's, with the parameter held at the interval's end."""
    x, count = np.array([-1.2, -0.9, -0.6, -0.3, 0.0]), np.full(5, 90.0)
    hits = np.array([46.0, 56.0, 72.0, 84.0, 88.0])
    search = LikelihoodSearch(x, count, 0.5, "logistic", lapse)
    best = search.best(hits[None, :])[0]
    top = search.likelihood(hits, best[None, :])[0]
    fall = 0.5 * chi2.ppf(0.95, 1)
    for end in search.interval(hits, best, which, fall):

        def less(rest, end=end):
            other, own = rest[0], end
            row = [own, np.exp(other), rest[1]] if which == THRESHOLD else [other, own, rest[1]]
            return -search.likelihood(hits, np.array([row]))[0]

        low, high = search.bounds
        bounds = [
            (np.log(low[1]), np.log(high[1])) if which == THRESHOLD else (low[0], high[0]),
            (low[2], high[2]),
        ]
        first = [np.log(best[1]) if which == THRESHOLD else best[0], best[2]]
        found = minimize(less, first, bounds=bounds, method="Nelder-Mead", options={"xatol": 1e-9})
        assert top + found.fun == pytest.approx(fall, abs=0.02)
