r"""A dragged hand whose probe also moves along the normal, and may leave the surface.

The model of the paper (Eq. 7) has a constant normal force and no motion along the normal. Here the
probe is a mass that the hand presses down through its tissue, a spring and a damper; the surface
pushes it up by a penalty (Eq. 4), and only up:

    m   u'' = k (v t - u) + b (v - u') - F_c h'(u)
    m_n z'' = -F_n - k_n (z - z_0) - b_n z' + F_c ,      F_c = k_c max(h(u) - z, 0) .

`h` is the offset surface (the path of a probe that never leaves it) and z_0 its mean, so that the
mean normal force is F_n. With a light probe on a stiff surface F_c tends to F_n, and the model to
that of the paper.

Each step of the classical Runge-Kutta method keeps one regime, contact or flight. A step at whose
end the gap has changed its sign is shortened by bisection to the time of the change, and the next
one starts in the other regime.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from asperity._core.arrays import Array
from asperity._core.kernels import inner_kernel, kernel
from asperity.dynamics.dragged_hand.hand import Hand, Motion, MotionStatus
from asperity.errors import AsperityError, require_not_negative, require_positive

_BISECTIONS = 50
_MAX_EVENTS = 16
"""Largest number of changes between contact and flight in one step; others are left to the next."""
_STEPS_PER_RADIAN = 20
"""Smallest number of steps per radian of the fastest free motion."""
_STEPS_PER_SAMPLE = 2
"""Smallest number of steps per sample of the surface."""


@dataclass(frozen=True)
class NormalProbe:
    """The probe along the normal, and the tissue that presses it; all values are asperity's."""

    mass: float = 0.01
    """Of the probe [kg], above 0."""
    stiffness: float = 500.0
    """Of the tissue [N/m], 0 or above."""
    damping: float = 2.0
    """Of the tissue [N s/m], 0 or above."""
    contact_stiffness: float = 2e4
    """Of the surface [N/m], above 0: k of Eq. 1."""

    def __post_init__(self) -> None:
        require_positive("mass", self.mass, "[kg]")
        require_not_negative("stiffness", self.stiffness, "[N/m]")
        require_not_negative("damping", self.damping, "[N s/m]")
        require_positive("contact_stiffness", self.contact_stiffness, "[N/m]")


@dataclass(frozen=True)
class LiftingMotion:
    """The motion of hand and probe over the recorded part of a drag."""

    motion: Motion
    """Of the hand along the surface; its status is APERIODIC."""
    height: Array
    """z of the probe's lowest point [m], at each sample."""
    contact_force: Array
    """F_c [N], 0 while the probe flies."""

    @property
    def share_in_flight(self) -> float:
        """Share of the samples at which the probe does not touch."""
        return float(np.mean(self.contact_force <= 0.0))


@kernel
def _surface(u, period, path):
    """Return height and slope at u of the cubic through one period of `path` (n, 2)."""
    n = path.shape[0]
    place = (u / period - math.floor(u / period)) * n
    i = min(int(place), n - 1)
    t, step = place - i, period / n
    j = (i + 1) % n
    h0, h1, s0, s1 = path[i, 0], path[j, 0], path[i, 1] * step, path[j, 1] * step
    a, c = 2.0 * (h0 - h1) + s0 + s1, 3.0 * (h1 - h0) - 2.0 * s0 - s1
    height = h0 + t * (s0 + t * (c + t * a))
    return height, (s0 + t * (2.0 * c + 3.0 * t * a)) / step


@inner_kernel
def _fill_rates(time, state, touches, model, path, rates_out):
    """Fill the rates of (u, u', z, z') in one regime; return the contact force."""
    m, k, b, v, m_n, k_n, b_n, k_c, force, middle, period = model
    height, slope = _surface(state[0], period, path)
    contact = k_c * (height - state[2]) if touches else 0.0
    rates_out[0] = state[1]
    rates_out[1] = (k * (v * time - state[0]) + b * (v - state[1]) - contact * slope) / m
    rates_out[2] = state[3]
    rates_out[3] = (-force - k_n * (state[2] - middle) - b_n * state[3] + contact) / m_n
    return contact


@inner_kernel
def _runge_kutta(time, step, state, touches, model, path, work, state_out):
    """Fill the state after one step in one regime; `work` (5, 4) holds rates and a state."""
    _fill_rates(time, state, touches, model, path, work[0])
    for stage in range(1, 4):
        part = step if stage == 3 else 0.5 * step
        for i in range(4):
            work[4, i] = state[i] + part * work[stage - 1, i]
        _fill_rates(time + part, work[4], touches, model, path, work[stage])
    for i in range(4):
        total = work[0, i] + 2.0 * work[1, i] + 2.0 * work[2, i] + work[3, i]
        state_out[i] = state[i] + step * total / 6.0


@kernel
def _gap(state, model, path):
    """Return the gap between probe and surface [m], negative in contact."""
    height, _ = _surface(state[0], model[10], path)
    return state[2] - height


@kernel
def run_lifting(model, path, step, settle, every, record_out):
    """Drag hand and probe; fill (u - v t, u', u'', z, F_c) at every `every`-th step after `settle`.

    Parameters
    ----------
    model : (11,) array
        m, k, b, v, m_n, k_n, b_n, k_c, F_n, z_0, and the period of the surface.
    path : (n, 2) array
        Heights and slopes of the offset surface at equally spaced positions of a period [m], [1].
    step : float
        [s]
    settle, every : int
        Steps before the record, and per sample.
    record_out : (samples, 5) array
    """
    state, after, work = np.empty(4), np.empty(4), np.empty((5, 4))
    # At rest on the surface, under the normal force.
    start, _ = _surface(0.0, model[10], path)
    state[0], state[1], state[2], state[3] = 0.0, model[3], start - model[8] / model[7], 0.0
    touches, time = True, 0.0
    for count in range(settle + record_out.shape[0] * every):
        if count >= settle and (count - settle) % every == 0:
            row = record_out[(count - settle) // every]
            row[4] = _fill_rates(time, state, touches, model, path, work[0])
            row[0], row[1], row[2] = state[0] - model[3] * time, state[1], work[0, 1]
            row[3] = state[2]
        remaining, end = step, (count + 1) * step
        for _ in range(_MAX_EVENTS):
            _runge_kutta(end - remaining, remaining, state, touches, model, path, work, after)
            above = _gap(after, model, path) > 0.0
            if above != touches:
                break
            low, high = 0.0, remaining
            for _ in range(_BISECTIONS):
                middle = 0.5 * (low + high)
                _runge_kutta(end - remaining, middle, state, touches, model, path, work, after)
                if (_gap(after, model, path) > 0.0) == touches:
                    high = middle
                else:
                    low = middle
            _runge_kutta(end - remaining, high, state, touches, model, path, work, after)
            state[:] = after
            touches = not touches
            remaining -= high
            if remaining <= 0.0:
                break
        state[:] = after
        time = end


def drag_lifting(
    heights: Array,
    slopes: Array,
    period: float,
    hand: Hand,
    probe: NormalProbe,
    *,
    normal_force: float,
    speed: float,
    length: float,
    settle: float | None = None,
    rate: float = 5000.0,
) -> LiftingMotion:
    """Drag a hand with a probe that can leave the surface.

    Parameters
    ----------
    heights, slopes : (n,) arrays
        Of the offset surface at n equally spaced positions of a period [m], [1], from a tracer.
    period : float
        [m]
    hand : Hand
    probe : NormalProbe
    normal_force : float
        Mean force of the hand on the probe [N], above 0.
    speed : float
        [m/s], above 0.
    length : float
        Of the recorded part [m], above 0.
    settle : float, optional
        Time before the record [s]; by default five time constants of the hand.
    rate : float
        Samples a second in the record [Hz].

    Returns
    -------
    LiftingMotion
    """
    for name, value, unit in (
        ("period", period, "[m]"), ("normal_force", normal_force, "[N]"),
        ("speed", speed, "[m/s]"), ("length", length, "[m]"), ("rate", rate, "[Hz]"),
    ):  # fmt: skip
        require_positive(name, value, unit)
    heights, slopes = (np.ascontiguousarray(a, dtype=np.float64) for a in (heights, slopes))
    if heights.ndim != 1 or heights.shape != slopes.shape or heights.size < 8:
        raise AsperityError(
            f"heights and slopes must be (n,) arrays of at least 8 samples, got {heights.shape} "
            f"and {slopes.shape}"
        )
    settle = 5.0 * hand.time_constant if settle is None else settle
    require_not_negative("settle", settle, "[s]")
    fastest = max(
        hand.fastest, math.sqrt((probe.contact_stiffness + probe.stiffness) / probe.mass),
        probe.damping / probe.mass,
    )  # fmt: skip
    finest = min(
        1.0 / (_STEPS_PER_RADIAN * fastest), period / heights.size / speed / _STEPS_PER_SAMPLE,
        1.0 / rate,
    )  # fmt: skip
    every = math.ceil(1.0 / rate / finest)
    step = 1.0 / rate / every
    record = np.empty((max(round(length / speed * rate), 2), 5))
    model = np.array([
        hand.mass, hand.stiffness, hand.damping, speed, probe.mass, probe.stiffness,
        probe.damping, probe.contact_stiffness, normal_force, float(np.mean(heights)), period,
    ])  # fmt: skip
    settled = math.ceil(settle / step)
    path = np.stack([heights, slopes], axis=1)
    run_lifting(model, path, step, settled, every, record)
    times = np.arange(record.shape[0]) / rate
    return LiftingMotion(
        Motion(
            status=MotionStatus.APERIODIC, periods=max(round(length / period), 1),
            settled_after=settled * step, step=1.0 / rate,
            place=record[:, 0] + speed * (times + settled * step), lag=record[:, 0],
            speed=record[:, 1], acceleration=record[:, 2], largest=float(record[:, 2].max()),
            smallest=float(record[:, 2].min()), mismatch=math.nan,
        ),
        record[:, 3].copy(), record[:, 4].copy(),
    )  # fmt: skip
