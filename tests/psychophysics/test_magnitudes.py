"""Magnitude estimates: normalised, averaged and fitted."""

import dataclasses

import numpy as np
import pytest
from fakes import MAGNITUDE, design
from scipy.stats import binom

from asperity.psychophysics.analysis.magnitudes import analyse_magnitudes
from asperity.psychophysics.analysis.results import AnsweredTrial, SessionResult
from asperity.psychophysics.session.trials import Trial

LEVELS = [5e-4, 1e-3, 1.5e-3, 2e-3, 2.5e-3, 3e-3, 3.5e-3]


def session(name, magnitude, modulus=1.0, noise=0.0, seed=0, blocks=3):
    """Return a session whose participant feels `magnitude` of each level."""
    made = design(MAGNITUDE, levels={"values": LEVELS})
    rng, given = np.random.default_rng(seed), []
    for block in range(1, blocks + 1):
        for stimulus in made.all_stimuli():
            answer = modulus * magnitude(stimulus.value) * 10.0 ** (noise * rng.normal())
            trial = Trial(len(given) + 1, "number", (stimulus,), block)
            given.append(AnsweredTrial(trial, answer, None, 1.0, ({},)))
    return SessionResult(name, 1, made, made.digest, tuple(given), True, True)


def test_a_participants_own_numbers_do_not_matter():
    def power(x):
        return x**0.7

    one = analyse_magnitudes(
        [session("A", power, noise=0.1), session("B", power, noise=0.1, seed=1)]
    )
    other = analyse_magnitudes(
        [session("A", power, noise=0.1), session("B", power, 50.0, 0.1, seed=1)]
    )
    # The grand mean is another, and nothing else.
    np.testing.assert_allclose(other.mean / one.mean, np.sqrt(50.0))
    np.testing.assert_allclose(other.exponent, one.exponent)
    np.testing.assert_allclose(other.high / other.low, one.high / one.low)


def test_a_power_law_comes_back_within_its_interval():
    found = analyse_magnitudes(
        [session(f"S{i}", lambda x: x**0.7, 3.0**i, 0.08, seed=i) for i in range(6)]
    )
    slope, low, high = found.exponent
    assert slope == pytest.approx(0.7, abs=0.05)
    assert low < 0.7 < high
    assert np.all((found.low <= found.mean) & (found.mean <= found.high))


def test_a_quadratic_comes_back():
    def peaked(x):
        return 10.0 ** (1.0 - 2.0 * (np.log10(x) - np.log10(2e-3)) ** 2)

    found = analyse_magnitudes([session("A", peaked)])
    assert found.fit.peak_spacing == pytest.approx(2e-3, rel=1e-6)
    assert found.fit.r_squared == pytest.approx(1.0)
    noisy = analyse_magnitudes([session("A", peaked, noise=0.05)])
    assert noisy.peak[0] < 2e-3 < noisy.peak[1]


def test_an_unfinished_block_does_not_tilt_the_mean():
    whole = session("A", lambda x: x)
    part = SessionResult("A", 1, whole.design, whole.digest, whole.answers[:-3], False, True)
    one, other = (analyse_magnitudes([s]) for s in (whole, part))
    ratio = other.mean / one.mean
    np.testing.assert_allclose(ratio, ratio[0])


def test_levels_are_sorted_and_names_need_no_value():
    made = design(MAGNITUDE, levels={"values": LEVELS[::-1]})
    given = tuple(
        AnsweredTrial(Trial(i, "number", (s,), 1), 1.0 + i, None, 1.0, ({},))
        for i, s in enumerate(made.all_stimuli(), 1)
    )
    found = analyse_magnitudes([SessionResult("A", 1, made, made.digest, given, True, True)])
    assert list(found.values) == LEVELS
    assert list(found.mean) == sorted(found.mean, reverse=True)


@pytest.mark.filterwarnings("error")
def test_a_session_that_was_broken_off_warns_of_nothing():
    whole = session("A", lambda x: x, noise=0.1)
    found = analyse_magnitudes([dataclasses.replace(whole, answers=whole.answers[:3])])
    assert np.count_nonzero(np.isfinite(found.mean)) == 3
    # One estimate of each stimulus tells nothing of how much they vary.
    assert not np.isfinite(found.low).any()


def power(rng, spread):
    """Return a power law whose exponent scatters about 0.7 between people."""
    exponent = 0.7 + spread * rng.normal()
    return lambda x: x**exponent


def peak(rng, spread):
    """Return a quadratic in log-log whose peak scatters about 2 mm between people."""
    top = np.log10(2e-3) + 0.3 * spread * rng.normal()
    return lambda x: 10.0 ** (-3.0 * (np.log10(x) - top) ** 2)


def analysed(people, feels, number=300):
    """Yield analyses of so many drawn experiments."""
    rng = np.random.default_rng(people)
    for _ in range(number):
        yield analyse_magnitudes([
            session(f"S{i}", feels(rng, 0.0 if people == 1 else 0.1), 10.0 ** rng.normal(), 0.12,
                    seed=int(rng.integers(2**31)))
            for i in range(people)
        ])  # fmt: skip


@pytest.mark.parametrize("people", [1, 2, 5, 10])
def test_intervals_have_the_truth_in_them(people):
    """Exponents, and means of stimuli: 83 % with one participant before, by bootstrap."""
    x, exponents, means = np.log10(LEVELS), [], []
    for found in analysed(people, power):
        _, low, high = found.exponent
        exponents.append(low < 0.7 < high)
        true = 0.7 * (x - x.mean()) + np.log10(found.mean).mean()
        means.append((np.log10(found.low) < true) & (true < np.log10(found.high)))
    lower, upper = binom.ppf([0.001, 0.999], 300, [0.93, 0.97]) / 300
    assert lower <= np.mean(exponents) <= upper
    assert lower <= np.mean(means) <= upper


@pytest.mark.parametrize("people", [1, 5])
def test_the_interval_of_the_peak_has_the_truth_in_it(people):
    inside = [
        found.peak is None or found.peak[0] < 2e-3 < found.peak[1]
        for found in analysed(people, peak)
    ]
    assert np.mean(inside) >= binom.ppf(0.001, 300, 0.93) / 300
