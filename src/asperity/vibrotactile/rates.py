"""A texture model at another rate: that of the device, or of the vibrator."""

from __future__ import annotations

from dataclasses import replace
from math import gcd

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError, require_between
from asperity.vibrotactile.ar import damped, levinson
from asperity.vibrotactile.lsf import coefficients_of, frequencies_of
from asperity.vibrotactile.model import Filter, TextureModel

_BINS = 1 << 14
_NARROWEST = 1.0
"""A refitted resonance is no narrower [Hz]."""


def at_rate(model: TextureModel, rate: float) -> TextureModel:
    """Return the model made for a lower rate [Hz].

    Each filter's spectrum up to half the new rate is kept, the rest is lost: its autocovariance at
    the new steps of time makes the new filter, of the same AR order, by Levinson's recursion. (HaTT
    resamples its models from 10 kHz to 1 kHz; the way is asperity's own, and so is that a
    moving-average part goes into the AR part.)

    Raises
    ------
    AsperityError
        The rate is above the model's; let it run at its own and interpolate with `raised`.
    """
    require_between("rate", rate, 100.0, model.rate, "Hz (a model has nothing above its own rate)")
    if rate == model.rate:
        return model
    order = max(model.order, model.ma.shape[1])
    frequency = np.linspace(0.0, 0.5 * rate, _BINS + 1)
    lsf, variance = np.empty((len(model.speeds), order)), np.empty(len(model.speeds))
    for i in range(len(model.speeds)):
        silent = model.variance[i] == 0.0
        power = _own_filter(model, i).density(frequency, model.rate)
        # A spectrum sampled from 0 to half the rate is a real, even one; its transform is the
        # autocovariance [m^2/s^4].
        covariance = np.fft.irfft(power)[: order + 1] * 0.5 * rate
        covariance[0] *= 1.0 + 1e-9
        fresh = damped(levinson(covariance), float(covariance[0]), rate, _NARROWEST)
        lsf[i] = frequencies_of(fresh.coefficients)
        variance[i] = 0.0 if silent else fresh.variance * model.variance[i]
    return replace(
        model, rate=rate, ar=lsf, variance=variance, ma=np.empty((0, 0)), gain=np.empty(0)
    )


def _own_filter(model: TextureModel, i: int) -> Filter:
    """Return filter i, for an excitation of variance 1, before any high-pass filter behind it."""
    ma = coefficients_of(model.ma[i]) * model.gain[i] if model.ma.shape[1] else np.ones(1)
    return Filter(coefficients_of(model.ar[i]), ma, 1.0)


def raised(samples: Array, rate: float, higher: float) -> Array:
    """Return samples at `rate` [Hz] as samples at a `higher` rate, with nothing new above.

    Whole rates [Hz]; polyphase, with Kaiser's window, so that nothing is delayed.
    """
    from scipy import signal

    low, high = round(rate), round(higher)
    if abs(low - rate) > 1e-6 or abs(high - higher) > 1e-6 or high < low:
        raise AsperityError(
            f"samples at {rate:g} Hz cannot be raised to {higher:g} Hz; valid: whole rates, the "
            "second not below the first"
        )
    common = gcd(low, high)
    return np.asarray(signal.resample_poly(samples, high // common, low // common))
