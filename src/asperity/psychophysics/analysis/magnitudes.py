"""Magnitude estimates: made comparable between participants, averaged, and fitted over the axis.

With a free modulus each participant uses numbers on a personal scale. The logarithms of a session's
estimates are therefore shifted so that their mean is that of all sessions: every estimate is
divided by the session's geometric mean and multiplied by the grand one, the usual normalisation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError
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
    """(n,): geometric mean over sessions."""
    low: Array
    high: Array
    fit: QuadraticFit | None
    """Log-log, as in section 4.2 of Otaduy & Lin (2004); None with fewer than four levels."""
    peak: tuple[float, float] | None
    """Interval of the quadratic's peak, in the unit of the axis; None where it has none."""
    exponent: tuple[float, float, float] | None
    """Of the power law (Stevens): slope in log-log, and its interval."""


def analyse_magnitudes(
    results: list[SessionResult], *, samples: int = 1000, confidence: float = 0.95, seed: int = 0
) -> Magnitudes:
    """Return normalised magnitudes and fits, with intervals by bootstrap.

    Drawn anew are participants' sessions where there are five or more of them, and the repeats of
    each stimulus within each session.
    """
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
    rng = np.random.default_rng(seed)
    table = _table(logs)
    again = np.array([_session_mean(_drawn(logs, rng)) for _ in range(samples)])
    tails = [50.0 * (1.0 - confidence), 100.0 - 50.0 * (1.0 - confidence)]
    mean = _session_mean(logs)
    low, high = np.full((2, len(names)), np.nan)
    known = np.isfinite(mean)
    # A stimulus that only one of several sessions reached may lack in a sample.
    low[known], high[known] = np.nanpercentile(again[:, known], tails, axis=0)
    usable = np.isfinite(values) & (values > 0.0) & np.isfinite(mean)
    fit, peak, exponent = None, None, None
    if np.count_nonzero(usable) >= LEAST_LEVELS:
        fit = fit_quadratic(values[usable], 10.0 ** mean[usable])
        if np.isfinite(fit.peak_spacing):
            tops = [
                fit_quadratic(values[usable], 10.0 ** row[usable]).peak_spacing for row in again
            ]
            # One that opens upwards has its peak nowhere: beyond either end.
            span = np.nanpercentile(tops, tails) if np.mean(np.isfinite(tops)) > 0.9 else None
            peak = None if span is None else (float(span[0]), float(span[1]))
    if np.count_nonzero(usable) >= 2:
        slopes = [_slope(values[usable], row[usable]) for row in again]
        span = np.nanpercentile(slopes, tails)
        exponent = (_slope(values[usable], mean[usable]), float(span[0]), float(span[1]))
    return Magnitudes(
        names, values, tuple(r.name for r in results), 10.0**table, 10.0**mean, 10.0**low,
        10.0**high, fit, peak, exponent,
    )  # fmt: skip


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


def _session_mean(logs: list[list[Array]]) -> Array:
    """Return the mean over sessions (n,), NaN where no session has an estimate."""
    table = _table(logs)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.nansum(table, axis=0) / np.isfinite(table).sum(axis=0))


def _drawn(logs: list[list[Array]], rng: np.random.Generator) -> list[list[Array]]:
    chosen = logs
    if len(logs) >= 5:
        chosen = [logs[i] for i in rng.integers(0, len(logs), len(logs))]
    return [
        [g[rng.integers(0, g.size, g.size)] if g.size else g for g in session] for session in chosen
    ]


def _slope(values: Array, logs: Array) -> float:
    return float(np.polyfit(np.log10(values), logs, 1)[0])
