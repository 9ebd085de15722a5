"""Means over participants, and conditions compared within them."""

import numpy as np
import pytest
from scipy.stats import binom, ttest_1samp, ttest_rel

from asperity.psychophysics.analysis.group import (
    compare,
    group,
    holm,
    noncentrality,
    random_effects,
)


def rows(values, errors, participants=None):
    """Return rows of thresholds with symmetric intervals of 95 % on a logarithmic scale."""
    names = participants or [f"P{i}" for i in range(len(values))]
    return [
        {"participant": name, "threshold": 10.0**v, "threshold_low": 10.0 ** (v - 1.96 * e),
         "threshold_high": 10.0 ** (v + 1.96 * e), "at_bound": False}
        for name, v, e in zip(names, values, errors, strict=True)
    ]  # fmt: skip


def test_equal_errors_give_the_t_interval_of_the_participants_means():
    values = np.array([-0.7, -0.5, -0.6, -0.3, -0.9])
    found = group(rows(values, np.full(5, 0.05)), "threshold", logarithmic=True)
    expected = ttest_1samp(values, 0.0).confidence_interval(0.95)
    np.testing.assert_allclose(np.log10(found.mean), [values.mean(), *expected], atol=1e-6)
    assert found.spread == pytest.approx(np.sqrt(values.var(ddof=1) - 0.05**2), rel=1e-3)


def test_random_effects_of_paule_and_mandel_solve_their_equation():
    values, errors = np.array([1.0, 2.0, 4.0, 1.5]), np.array([0.2, 0.5, 0.3, 1.0])
    mean, _, spread = random_effects(values, errors)
    weights = 1.0 / (errors**2 + spread**2)
    assert mean == pytest.approx(weights @ values / weights.sum())
    assert weights @ (values - mean) ** 2 == pytest.approx(3.0)
    # People who differ by less than their errors do not differ.
    assert random_effects(np.array([1.0, 1.01, 0.99]), np.full(3, 0.5))[2] == 0.0


@pytest.mark.parametrize("people", [3, 5, 10])
@pytest.mark.parametrize("spread", [0.0, 0.05, 0.2])
def test_the_interval_of_the_mean_has_the_truth_in_it(people, spread):
    rng, inside, sessions = np.random.default_rng(1), 0, 1000
    for _ in range(sessions):
        errors = rng.uniform(0.03, 0.1, people)
        values = -0.6 + rng.normal(0.0, np.hypot(spread, errors))
        mean = group(rows(values, errors), "threshold", logarithmic=True).mean
        inside += mean.low < 10.0**-0.6 < mean.high
    lower, upper = binom.ppf([0.001, 0.999], sessions, [0.93, 0.97])
    assert lower <= inside <= upper


def test_sessions_of_one_person_count_once_and_failed_ones_not_at_all():
    made = rows([-0.6, -0.4, -0.8], [0.1, 0.1, 0.1], ["A", "A", "B"])
    found = group(made, "threshold", logarithmic=True)
    assert found.participants == ("A", "B")
    assert np.log10(found.estimates[0].value) == pytest.approx(-0.5)
    made[2]["at_bound"] = True
    found = group(made, "threshold", logarithmic=True)
    assert found.participants == ("A",)
    assert np.isnan(found.mean.low)
    assert group(made[2:], "threshold", logarithmic=True) is None


def test_conditions_are_compared_within_people():
    rng = np.random.default_rng(3)
    a = rng.normal(-0.7, 0.2, 8)
    b = a + 0.15 + rng.normal(0.0, 0.05, 8)
    groups = {
        "one": group(rows(a, np.full(8, 0.04)), "threshold", logarithmic=True),
        # Another order of people, and one who was in this condition alone.
        "two": group(
            rows([0.0, *b[::-1]], np.full(9, 0.04), ["X", *[f"P{i}" for i in range(8)][::-1]]),
            "threshold", logarithmic=True,
        ),
    }  # fmt: skip
    (found,) = compare(groups)
    paired = ttest_rel(b, a)
    assert found.people == 8
    assert found.t == pytest.approx(paired.statistic)
    assert found.p == pytest.approx(paired.pvalue)
    ends = paired.confidence_interval(0.95)
    np.testing.assert_allclose(np.log10(found.effect), [np.mean(b - a), *ends])
    assert found.effect_size.value == pytest.approx(np.mean(b - a) / np.std(b - a, ddof=1))
    assert found.effect_size.low < found.hedges < found.effect_size.value


def test_the_interval_of_the_effect_size_has_the_truth_in_it():
    rng, inside = np.random.default_rng(4), 0
    for _ in range(400):
        apart = rng.normal(0.8, 1.0, 6)
        statistic = np.sqrt(6) * apart.mean() / apart.std(ddof=1)
        low, high = np.array(noncentrality(statistic, 5, 0.95)) / np.sqrt(6)
        inside += low < 0.8 < high
    assert binom.ppf(0.001, 400, 0.95) <= inside <= binom.ppf(0.999, 400, 0.95)


def test_holm_is_as_in_his_example():
    # Holm (1979): steps of m p, (m - 1) p, ..., never falling.
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
