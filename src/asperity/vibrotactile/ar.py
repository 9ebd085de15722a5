r"""Autoregressive models of a signal: estimated, judged, and kept from ringing for ever.

`x_n = -sum_(i=1..p) a_i x_(n-i) + e_n`, e white of variance s^2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError, require_choice
from asperity.vibrotactile.lsf import power_gain

CRITERIA = ("bic", "aic")


class Autoregression(NamedTuple):
    """An AR model, and how it was come by."""

    coefficients: Array
    """(p + 1,), the first 1."""
    variance: float
    """Of the excitation."""
    samples: int
    """Samples that it was estimated from."""


def burg(segments: Sequence[Array], order: int) -> list[Autoregression]:
    """Return the AR models of orders 0 to `order` of stretches of one signal.

    Burg's method (1975): every reflection coefficient makes the forward and backward prediction
    errors, summed over all stretches, least. The filters are stable whatever the data are.

    Parameters
    ----------
    segments : sequence of (n_i,) arrays
        Stretches of one and the same process, without its mean. Each longer than `order`.
    order : int
    """
    forward = [np.asarray(s, dtype=np.float64) for s in segments]
    if not forward or min(s.size for s in forward) <= order:
        raise AsperityError(f"an AR model of order {order} needs stretches longer than that")
    backward = list(forward)
    count = sum(s.size for s in forward)
    variance = sum(float(s @ s) for s in forward) / count
    if not variance > 0.0:
        raise AsperityError("the signal is zero throughout: there is no vibration to fit")
    a = np.ones(1)
    out = [Autoregression(a, variance, count)]
    for _ in range(order):
        ahead = [f[1:] for f in forward]
        behind = [b[:-1] for b in backward]
        product = sum(float(f @ b) for f, b in zip(ahead, behind, strict=True))
        power = sum(float(f @ f + b @ b) for f, b in zip(ahead, behind, strict=True))
        k = -2.0 * product / power if power > 0.0 else 0.0
        forward = [f + k * b for f, b in zip(ahead, behind, strict=True)]
        backward = [b + k * f for f, b in zip(ahead, behind, strict=True)]
        a = np.append(a, 0.0) + k * np.append(0.0, a[::-1])
        variance *= 1.0 - k * k
        out.append(Autoregression(a, max(variance, 1e-300), count))
    return out


def criterion(model: Autoregression, kind: str = "bic") -> float:
    """Return Akaike's (1974) or Schwarz's (1978) criterion of an AR model: less is better."""
    require_choice("criterion", kind, CRITERIA)
    each = 2.0 if kind == "aic" else math.log(model.samples)
    return model.samples * math.log(model.variance) + each * (model.coefficients.size - 1)


def levinson(covariance: Array, count: int = 0) -> Autoregression:
    """Return the AR model of order p with autocovariance (p + 1,): Levinson and Durbin."""
    a, error = np.ones(1), float(covariance[0])
    for i in range(1, covariance.size):
        k = -float(a @ covariance[i:0:-1]) / error
        if not abs(k) < 1.0:
            break
        a = np.append(a, 0.0) + k * np.append(0.0, a[::-1])
        error *= 1.0 - k * k
    a = np.append(a, np.zeros(covariance.size - a.size))
    return Autoregression(a, error, count)


def damped(model: Autoregression, power: float, rate: float, bandwidth: float) -> Autoregression:
    """Return the model with no resonance narrower than `bandwidth` [Hz], and of a given power.

    A texture that repeats exactly has lines for a spectrum. An AR model of it has poles as good as
    on the unit circle: its level would wander for seconds, and no interpolation would be safe. All
    poles are drawn inwards (the bandwidth expansion of speech coding: `a_i g^i`) as far as the
    outermost needs it.

    `power` is that of the signal: of a model that close to the circle it cannot be computed.
    """
    a = model.coefficients
    if a.size < 2:
        return model
    outermost = float(np.max(np.abs(np.roots(a))))
    allowed = math.exp(-math.pi * bandwidth / rate)
    if outermost <= allowed:
        return model
    narrowed = a * (allowed / outermost) ** np.arange(a.size)
    return Autoregression(narrowed, power / power_gain(narrowed), model.samples)
