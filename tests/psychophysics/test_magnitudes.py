"""Magnitude estimates: normalised, averaged and fitted."""

import dataclasses

import numpy as np
import pytest
from fakes import MAGNITUDE, design

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
        [session("A", power, noise=0.1), session("B", power, noise=0.1, seed=1)], samples=100
    )
    other = analyse_magnitudes(
        [session("A", power, noise=0.1), session("B", power, 50.0, 0.1, seed=1)], samples=100
    )
    # The grand mean is another, and nothing else.
    np.testing.assert_allclose(other.mean / one.mean, np.sqrt(50.0))
    np.testing.assert_allclose(other.exponent, one.exponent)
    np.testing.assert_allclose(other.high / other.low, one.high / one.low)


def test_a_power_law_comes_back_within_its_interval():
    found = analyse_magnitudes(
        [session(f"S{i}", lambda x: x**0.7, 3.0**i, 0.08, seed=i) for i in range(6)], samples=300
    )
    slope, low, high = found.exponent
    assert slope == pytest.approx(0.7, abs=0.05)
    assert low < 0.7 < high
    assert np.all((found.low <= found.mean) & (found.mean <= found.high))


def test_a_quadratic_comes_back():
    def peaked(x):
        return 10.0 ** (1.0 - 2.0 * (np.log10(x) - np.log10(2e-3)) ** 2)

    found = analyse_magnitudes([session("A", peaked)], samples=100)
    assert found.fit.peak_spacing == pytest.approx(2e-3, rel=1e-6)
    assert found.fit.r_squared == pytest.approx(1.0)
    noisy = analyse_magnitudes([session("A", peaked, noise=0.05)], samples=300)
    assert noisy.peak[0] < 2e-3 < noisy.peak[1]


def test_an_unfinished_block_does_not_tilt_the_mean():
    whole = session("A", lambda x: x)
    part = SessionResult("A", 1, whole.design, whole.digest, whole.answers[:-3], False, True)
    one, other = (analyse_magnitudes([s], samples=50) for s in (whole, part))
    ratio = other.mean / one.mean
    np.testing.assert_allclose(ratio, ratio[0])


def test_levels_are_sorted_and_names_need_no_value():
    made = design(MAGNITUDE, levels={"values": LEVELS[::-1]})
    given = tuple(
        AnsweredTrial(Trial(i, "number", (s,), 1), 1.0 + i, None, 1.0, ({},))
        for i, s in enumerate(made.all_stimuli(), 1)
    )
    found = analyse_magnitudes(
        [SessionResult("A", 1, made, made.digest, given, True, True)], samples=50
    )
    assert list(found.values) == LEVELS
    assert list(found.mean) == sorted(found.mean, reverse=True)


@pytest.mark.filterwarnings("error")
def test_a_session_that_was_broken_off_warns_of_nothing():
    whole = session("A", lambda x: x, noise=0.1)
    found = analyse_magnitudes([dataclasses.replace(whole, answers=whole.answers[:3])], samples=50)
    assert np.count_nonzero(np.isfinite(found.mean)) == 3
    assert np.array_equal(np.isfinite(found.low), np.isfinite(found.mean))
