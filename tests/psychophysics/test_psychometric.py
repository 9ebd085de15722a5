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
    QUANTITIES,
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


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("lapse", [None, 0.03])
def test_an_interval_ends_where_the_likelihood_has_fallen(quantity, lapse):
    """Beside an optimiser of SciPy's, with the quantity held at the interval's end."""
    x, count = np.array([-1.2, -0.9, -0.6, -0.3, 0.0]), np.full(5, 90.0)
    hits = np.array([46.0, 56.0, 72.0, 84.0, 88.0])
    search = LikelihoodSearch(x, count, 0.5, "logistic", lapse, 0.8)
    best = search.best(hits[None, :])[0]
    top = search.likelihood(hits, best[None, :])[0]
    fall = 0.5 * chi2.ppf(0.95, 1)
    low, high = search.bounds
    if quantity == "lapse":
        ends = search.interval(hits, best, quantity, fall)
        assert low[2] <= ends[0] <= best[2] <= ends[1] <= high[2]
        return
    for end in search.interval(hits, best, quantity, fall):

        def row(p):
            return np.array([[p[0], np.exp(p[1]), p[2]]])

        bounds = [(low[0], high[0]), tuple(np.log([low[1], high[1]])), (low[2], high[2])]
        held = {"type": "eq", "fun": lambda p, end=end: search.of(quantity, row(p))[0] - end}
        found = min(
            (minimize(lambda p: -search.likelihood(hits, row(p))[0],
                      (best[0], np.log(best[1]) + shift, best[2]), bounds=bounds, method="SLSQP",
                      constraints=[held])
             for shift in (-0.3, 0.0, 0.3)),
            key=lambda result: result.fun if result.success else np.inf,
        )  # fmt: skip
        assert top + found.fun == pytest.approx(fall, abs=0.05)


def test_slope_and_level_are_those_of_the_function():
    f = Psychometric(-0.7, 0.6, 0.03, 0.5, "weibull")
    assert f.slope == pytest.approx(float(f(-0.7 + 1e-6) - f(-0.7 - 1e-6)) / 2e-6, rel=1e-4)
    x = np.repeat(np.linspace(-1.4, 0.0, 6), 60)
    right = np.random.default_rng(2).random(x.size) < f(x)
    fit = fit_psychometric(x, right, samples=10, proportion=0.8)
    assert fit.level.low < fit.function.at(0.8) < fit.level.high
    assert fit.slope.low < fit.function.slope < fit.slope.high
    assert fit_psychometric(x, right, samples=10, proportion=0.4).level is None


PUBLISHED = [
    # psignifit 3 (Fruend, Haenel & Wichmann 2011, J. Vision 11(6):16), tests of its command line,
    # `psignifit-mapestimate`: x from 0 by 2, 50 trials each; two intervals, and yes/no with the
    # lower asymptote equal to the lapse rate. Its width is from F = 0.1 to 0.9.
    ("logistic", 0.5, 2.0 * np.arange(6), [34, 32, 40, 48, 50, 48], 50,
     2.751832, 6.403953 * np.log(19.0) / np.log(9.0), 0.015555, 8.071331),
    ("logistic", None, 2.0 * np.arange(6), [2, 21, 29, 42, 50, 49], 50,
     3.210313, 6.261821 * np.log(19.0) / np.log(9.0), 0.001765, 10.616),
    # quickpsy (Linares & Lopez-Moliner 2016, R Journal 8, 122-131), its page on guesses and lapses:
    # mean and standard deviation of a cumulative normal, and lapse rate.
    ("normal", 0.5, 0.2 * np.arange(1, 6), [59, 56, 69, 92, 94], 100,
     0.610, 2.0 * 1.644854 * 0.136, 0.0545, None),
]  # fmt: skip


@pytest.mark.parametrize(
    ("function", "guess", "x", "hits", "count", "threshold", "width", "lapse", "deviance"),
    PUBLISHED,
)
def test_published_fits_of_other_programs(
    function, guess, x, hits, count, threshold, width, lapse, deviance
):
    right = np.concatenate([np.arange(count) < k for k in hits])
    fit = fit_psychometric(
        np.repeat(x, count), right, guess=guess, function=function, samples=10, quantities=()
    )
    assert fit.function.threshold == pytest.approx(threshold, rel=0.001)
    assert fit.function.width == pytest.approx(width, rel=0.005)
    assert fit.function.lapse == pytest.approx(lapse, abs=2e-4)
    if deviance is not None:
        assert fit.deviance == pytest.approx(deviance, abs=0.01)
