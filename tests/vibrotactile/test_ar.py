"""AR models: known ones are found again, orders are chosen, resonances are widened."""

import numpy as np
import pytest
from scipy import signal
from scipy.linalg import inv, toeplitz

from asperity.errors import AsperityError
from asperity.vibrotactile.ar import (
    Autoregression,
    burg,
    criterion,
    damped,
    levinson,
)
from asperity.vibrotactile.lsf import is_stable, power_gain
from asperity.vibrotactile.model import Filter

# Two resonances, at 0.11 and 0.29 of the rate.
KNOWN = np.real(
    np.poly(
        [
            0.95 * np.exp(2j * np.pi * 0.11), 0.95 * np.exp(-2j * np.pi * 0.11),
            0.85 * np.exp(2j * np.pi * 0.29), 0.85 * np.exp(-2j * np.pi * 0.29),
        ]
    )
)  # fmt: skip
VARIANCE = 0.3


def density(model, frequency, rate):
    return Filter(model.coefficients, np.ones(1), model.variance).density(frequency, rate)


def made(count, seed):
    noise = np.sqrt(VARIANCE) * np.random.default_rng(seed).standard_normal(count + 500)
    return signal.lfilter([1.0], KNOWN, noise)[500:]


def autocovariance(lags):
    """Return the autocovariance (lags + 1,) of the known process, from its impulse response."""
    response = signal.lfilter([1.0], KNOWN, np.eye(1, 2000)[0])
    return VARIANCE * np.array([response[: 2000 - k] @ response[k:] for k in range(lags + 1)])


def test_known_coefficients_are_recovered_within_their_standard_error():
    away, variances = [], []
    # The large-sample covariance of an efficient estimator (Brockwell & Davis 1991, 8.10).
    covariance = VARIANCE * inv(toeplitz(autocovariance(3))) / 4000
    for seed in range(40):
        model = burg([made(4000, seed)], 4)[-1]
        away.append((model.coefficients[1:] - KNOWN[1:]) / np.sqrt(np.diag(covariance)))
        variances.append(model.variance)
    away = np.array(away)
    # Forty tries: the errors are as large as the standard errors say, and have no bias.
    assert np.sqrt(np.mean(away**2, axis=0)) == pytest.approx(np.ones(4), abs=0.35)
    assert np.abs(away).max() < 4.0
    assert np.abs(away.mean(axis=0)).max() < 3.5 / np.sqrt(40)
    # The deviation of a variance is sqrt(2 / n) of it.
    assert np.mean(variances) == pytest.approx(VARIANCE, rel=3.5 * np.sqrt(2 / 4000 / 40) + 2e-3)


def test_stretches_are_pooled():
    parts = [made(500, seed) for seed in range(8)]
    one, all_of_them = burg(parts[:1], 4)[-1], burg(parts, 4)[-1]
    assert all_of_them.samples == 8 * one.samples
    assert np.linalg.norm(all_of_them.coefficients - KNOWN) < np.linalg.norm(
        one.coefficients - KNOWN
    )


def test_bic_finds_the_order():
    found = [
        int(np.argmin([criterion(m) for m in burg([made(4000, seed)], 12)])) for seed in range(10)
    ]
    assert found.count(4) >= 9


def test_levinson_inverts_the_autocovariance():
    covariance = autocovariance(12)
    assert covariance[0] == pytest.approx(VARIANCE * power_gain(KNOWN))
    back = levinson(covariance[:5])
    assert back.coefficients == pytest.approx(KNOWN, abs=1e-10)
    assert back.variance == pytest.approx(VARIANCE)
    # The equations of Yule and Walker hold at longer lags too.
    for lag in (5, 6, 9, 12):
        follows = -KNOWN[1:] @ covariance[lag - 1 : lag - 5 : -1]
        assert covariance[lag] == pytest.approx(follows, rel=1e-9)


def test_a_pure_tone_is_widened_and_keeps_its_power():
    rate, n = 1000.0, 4000
    tone = np.sin(2 * np.pi * 100.0 * np.arange(n) / rate)
    ladder = burg([tone], 6)
    model = damped(ladder[-1], ladder[0].variance, rate, 4.0)
    assert is_stable(model.coefficients)
    radius = np.max(np.abs(np.roots(model.coefficients)))
    assert -np.log(radius) * rate / np.pi == pytest.approx(4.0, rel=1e-3)
    assert model.variance * power_gain(model.coefficients) == pytest.approx(0.5, rel=0.02)
    frequency = np.linspace(20, 480, 2000)
    assert frequency[np.argmax(density(model, frequency, rate))] == pytest.approx(100.0, abs=1.0)


def test_density_sums_to_the_power():
    model = Autoregression(KNOWN, VARIANCE, 1000)
    frequency = np.linspace(0.0, 500.0, 20001)
    total = np.trapezoid(density(model, frequency, 1000.0), frequency)
    assert total == pytest.approx(VARIANCE * power_gain(KNOWN), rel=1e-6)


def test_nothing_to_fit_is_said():
    with pytest.raises(AsperityError, match="zero throughout"):
        burg([np.zeros(100)], 4)
    with pytest.raises(AsperityError, match="longer"):
        burg([np.ones(4)], 4)
