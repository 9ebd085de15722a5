"""Magnitude estimates: made comparable between participants, averaged, and fitted over the axis.

With a free modulus each participant uses numbers on a personal scale. The logarithms of a session's
estimates are therefore shifted so that their mean is that of all sessions: every estimate is
divided by the session's geometric mean and multiplied by the grand one, the usual normalisation.
Sessions of one participant are averaged.

Intervals are Student's t. With several participants they are of the variation between them (means
of stimuli: Cousineau 2005, Tutor. Quant. Methods Psychol. 1, 42-45, with the correction of Morey
2008, ibid. 4, 61-64), so that they hold for people like these. With one participant they are of the
variation between the repeats, and hold for this one. The interval of a quadratic's peak, a ratio of
two coefficients, is by Fieller's theorem (1954, J. R. Stat. Soc. B 16, 175-185).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t

from asperity._core.arrays import Array
from asperity.errors import AsperityError
from asperity.psychophysics.analysis.detection import Estimate
from asperity.psychophysics.analysis.results import SessionResult
from asperity.studies.otaduy_lin_2004.peak_fit import QuadraticFit, fit_quadratic

LEAST_LEVELS = 4
"""Smallest number of levels for a quadratic fit."""


@dataclass(frozen=True)
class Magnitudes:
    """Normalised magnitude estimates and fits."""

    names: tuple[str, ...]
    values: Array
    """(n,) of the axis; NaN where a stimulus has none."""
    sessions: tuple[str, ...]
    by_session: Array
    """(sessions, n): geometric means of the normalised estimates; NaN where there is none."""
    mean: Array
    """(n,): geometric mean over participants."""
    low: Array
    high: Array
    """Ends of its interval; NaN without repeats and with one participant."""
    fit: QuadraticFit | None
    """Log-log, as in section 4.2 of Otaduy & Lin (2004); None with fewer than four levels."""
    peak: tuple[float, float] | None
    """Interval of the quadratic's peak, in the unit of the axis; None where it has none, or an
    infinite one."""
    exponent: tuple[float, float, float] | None
    """Of the power law (Stevens): slope in log-log, and its interval."""
    exponents: dict[str, Estimate]
    """The same of each participant, with the interval of the repeats."""


class _Person(NamedTuple):
    """One participant's normalised logarithms: mean of each stimulus, and how often it came."""

    mean: Array
    trials: Array
    variance: float
    """Of one estimate, from the repeats; NaN without any."""
    freedom: int


def analyse_magnitudes(results: list[SessionResult], *, confidence: float = 0.95) -> Magnitudes:
    """Return normalised magnitudes and fits, with intervals."""
    stimuli = results[0].design.all_stimuli()
    names = tuple(s.name for s in stimuli)
    values = np.array([np.nan if s.value is None else s.value for s in stimuli])
    order = np.argsort(values, kind="stable")
    names, values = tuple(names[i] for i in order), values[order]
    raw = [_logs(result, names) for result in results]
    grand = float(np.mean([np.mean(np.concatenate(session)) for session in raw]))
    # The mean of stimuli's means: an unfinished block does not tilt it.
    centres = [float(np.mean([group.mean() for group in session if group.size])) for session in raw]
    logs = [
        [group - centre + grand for group in session]
        for session, centre in zip(raw, centres, strict=True)
    ]
    people: dict[str, list[list[Array]]] = {}
    for result, session in zip(results, logs, strict=True):
        people.setdefault(result.participant, []).append(session)
    persons = {name: _person(sessions) for name, sessions in people.items()}
    table = np.array([person.mean for person in persons.values()])
    mean = _known_mean(table)
    half = _half(list(persons.values()), confidence)
    axis = np.isfinite(values) & (values > 0.0)
    fit, peak = None, None
    usable = axis & np.isfinite(mean)
    if np.count_nonzero(usable) >= LEAST_LEVELS:
        fit = fit_quadratic(values[usable], 10.0 ** mean[usable])
        if np.isfinite(fit.peak_spacing):
            peak = _peak(values, list(persons.values()), axis, confidence)
    exponents = {
        name: Estimate(*slope)
        for name, person in persons.items()
        if (slope := _exponent(values, [person], axis, confidence)) is not None
    }
    return Magnitudes(
        names, values, tuple(r.name for r in results), 10.0 ** _table(logs), 10.0**mean,
        10.0 ** (mean - half), 10.0 ** (mean + half), fit, peak,
        _exponent(values, list(persons.values()), axis, confidence), exponents,
    )  # fmt: skip


def _person(sessions: list[list[Array]]) -> _Person:
    """Return one participant's means over sessions, and the variance of an estimate."""
    groups = [np.concatenate(group) for group in zip(*sessions, strict=True)]
    apart = [g - g.mean() for session in sessions for g in session if g.size > 1]
    freedom = sum(g.size - 1 for g in apart)
    variance = sum(float(g @ g) for g in apart) / freedom if freedom else float("nan")
    mean = np.array([g.mean() if g.size else np.nan for g in groups])
    return _Person(mean, np.array([float(g.size) for g in groups]), variance, freedom)


def _known_mean(table: Array) -> Array:
    """Return the mean over rows (n,), NaN where no row has a value."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.nansum(table, axis=0) / np.isfinite(table).sum(axis=0))


def _half(persons: list[_Person], confidence: float) -> Array:
    """Return half the intervals (n,) of the means of stimuli; NaN where there is none."""
    part = 0.5 + 0.5 * confidence
    with np.errstate(invalid="ignore", divide="ignore"):
        if len(persons) == 1:
            one = persons[0]
            return np.asarray(t.ppf(part, one.freedom) * np.sqrt(one.variance / one.trials))
        table = np.array([person.mean for person in persons])
        known = np.isfinite(table).sum(axis=0).astype(np.float64)
        # Morey's correction: normalising took a part of the variance out.
        count = max(table.shape[1], 2)
        squares = np.nansum((table - _known_mean(table)) ** 2, axis=0) / (known - 1.0)
        error = np.sqrt(squares * count / (count - 1.0) / known)
        return np.asarray(t.ppf(part, known - 1.0) * error)


def _coefficients(
    values: Array, persons: list[_Person], axis: NDArray[np.bool_], degree: int
) -> tuple[Array, Array, int] | None:
    """Return the coefficients in log-log, highest first, their covariance, and its freedom.

    None where no participant has estimates of enough stimuli.
    """
    rows: list[Array] = []
    for person in persons:
        used = axis & np.isfinite(person.mean)
        if np.count_nonzero(used) <= degree:
            continue
        powers = np.vander(np.log10(values[used]), degree + 1)
        y, count = person.mean[used], person.trials[used]
        inverse = np.linalg.inv((powers.T * count) @ powers)
        row = inverse @ (powers.T * count) @ y
        if len(persons) == 1:
            variance, freedom = person.variance, person.freedom
            if freedom == 0:  # without repeats the distance from the curve has to do
                freedom = len(y) - degree - 1
                variance = float(np.sum((y - powers @ row) ** 2)) / freedom if freedom else np.nan
            return row, variance * inverse, freedom
        rows.append(row)
    if not rows:
        return None
    table = np.array(rows)
    covariance = np.atleast_2d(np.cov(table.T)) if len(rows) > 1 else np.nan * np.eye(degree + 1)
    return table.mean(axis=0), covariance / len(rows), len(rows) - 1


def _exponent(
    values: Array, persons: list[_Person], axis: NDArray[np.bool_], confidence: float
) -> tuple[float, float, float] | None:
    """Return the slope in log-log and its interval."""
    found = _coefficients(values, persons, axis, 1)
    if found is None:
        return None
    row, covariance, freedom = found
    half = float(t.ppf(0.5 + 0.5 * confidence, freedom) * np.sqrt(covariance[0, 0]))
    return float(row[0]), float(row[0]) - half, float(row[0]) + half


def _peak(
    values: Array, persons: list[_Person], axis: NDArray[np.bool_], confidence: float
) -> tuple[float, float] | None:
    """Return the interval of the quadratic's peak, by Fieller's theorem; None if infinite."""
    found = _coefficients(values, persons, axis, 2)
    if found is None:
        return None
    (c2, c1, _), covariance, freedom = found
    limit = float(t.ppf(0.5 + 0.5 * confidence, freedom)) ** 2
    # The x at which the slope c1 + 2 c2 x is not significantly different from 0.
    a = 4.0 * (c2 * c2 - limit * covariance[0, 0])
    b = 4.0 * (c1 * c2 - limit * covariance[0, 1])
    c = c1 * c1 - limit * covariance[1, 1]
    inside = b * b - 4.0 * a * c
    if not (a > 0.0 and inside >= 0.0):
        return None
    ends = [(-b - np.sqrt(inside)) / (2.0 * a), (-b + np.sqrt(inside)) / (2.0 * a)]
    low, high = np.clip(ends, -300.0, 300.0)
    return float(10.0**low), float(10.0**high)


def _logs(result: SessionResult, names: tuple[str, ...]) -> list[Array]:
    """Return the logarithms of a session's estimates, by stimulus."""
    session: list[list[float]] = [[] for _ in names]
    for answered in result.answers:
        answer = answered.answer
        if isinstance(answer, list):
            raise AsperityError(f"magnitude estimates must be numbers, got {answer!r}")
        session[names.index(answered.trial.stimuli[0].name)].append(float(np.log10(answer)))
    return [np.array(group) for group in session]


def _table(logs: list[list[Array]]) -> Array:
    return np.array(
        [[group.mean() if group.size else np.nan for group in session] for session in logs]
    )
