"""People together: the mean of a measure over participants, and conditions compared within them.

Two stages. Each participant has an estimate and its standard error; the participants' own values
are taken as drawn from a normal population (random effects). The variance between people follows
from Paule & Mandel's equation (1982, J. Res. Natl. Bur. Stand. 87, 377-385), and the interval of
the mean from Student's t with the variance of Hartung & Knapp (2001, Stat. Med. 20, 3875-3889).
With equal errors it is the t interval of the participants' values. It holds with as few as three
people, where a bootstrap over participants is too narrow.

Conditions are compared within people by a paired t test of their differences; the effect size is
the mean difference over its standard deviation (Cohen's d_z), with the interval of the noncentral t
distribution, and Hedges' correction (1981, J. Educ. Stat. 6, 107-128). More than one comparison:
Holm's p (1979, Scand. J. Stat. 6, 65-70).

Measures above 0, such as thresholds on a logarithmic scale, are averaged as logarithms: the mean is
geometric, a difference is a ratio.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import gammaln
from scipy.stats import nct, norm, t

from asperity._core.arrays import Array
from asperity.psychophysics.analysis.detection import Estimate


@dataclass(frozen=True)
class Group:
    """A measure over participants."""

    participants: tuple[str, ...]
    estimates: tuple[Estimate, ...]
    """Of each participant; of several sessions, their mean."""
    logarithmic: bool
    mean: Estimate
    """NaN intervals where there is one participant."""
    spread: float
    """Standard deviation between people, without that of the estimates; of the decimal logarithm,
    if logarithmic."""

    @property
    def summary(self) -> dict[str, Any]:
        """The group as a dict of JSON values."""
        return {
            "participants": {
                name: spanned(one)
                for name, one in zip(self.participants, self.estimates, strict=True)
            },
            "mean": spanned(self.mean),
            "geometric": self.logarithmic,
            "sd_between_people": plain((self.spread,))[0],
        }  # fmt: skip


@dataclass(frozen=True)
class PairedComparison:
    """A measure in two conditions, within people: the second less, or over, the first."""

    first: str
    second: str
    people: int
    effect: Estimate
    """Mean difference, or ratio if logarithmic."""
    logarithmic: bool
    t: float
    p: float
    p_holm: float
    effect_size: Estimate
    """Cohen's d_z."""
    hedges: float
    """d_z with Hedges' correction."""

    @property
    def summary(self) -> dict[str, Any]:
        """The comparison as a dict of JSON values."""
        return {
            "first": self.first, "second": self.second, "people": self.people,
            "ratio" if self.logarithmic else "difference": spanned(self.effect),
            "t": plain((self.t,))[0], "degrees_of_freedom": self.people - 1, "p": self.p,
            "p_holm": self.p_holm,
            "cohens_dz": spanned(self.effect_size),
            "hedges_gz": plain((self.hedges,))[0],
        }  # fmt: skip


def group(
    rows: list[dict[str, Any]], measure: str, *, logarithmic: bool, confidence: float = 0.95
) -> Group | None:
    """Return the mean of a measure over the participants of sessions.

    Parameters
    ----------
    rows : list of dict
        Rows of `thresholds.csv`, of one condition. Sessions whose threshold is at the end of what
        was searched, or in which the measure is missing, are left out.
    measure : str
        The name of its column; the interval is in the columns with `_low` and `_high`.
    logarithmic : bool
    confidence : float
        Of the rows' intervals, and of the mean's.

    Returns
    -------
    Group or None
        None where no session is left.
    """
    logs: dict[str, list[tuple[float, float]]] = {}
    exact: dict[str, list[Estimate]] = {}
    sigmas = 2.0 * float(norm.ppf(0.5 + 0.5 * confidence))
    for row in rows:
        given = [row.get(f"{measure}{end}") for end in ("", "_low", "_high")]
        values = np.array([np.nan if v is None else v for v in given], dtype=np.float64)
        if not np.isfinite(values).all() or row.get("at_bound"):
            continue
        if logarithmic and values.min() <= 0.0:
            continue
        middle, low, high = np.log10(values) if logarithmic else values
        logs.setdefault(row["participant"], []).append((middle, (high - low) / sigmas))
        exact.setdefault(row["participant"], []).append(Estimate(*map(float, values)))
    if not logs:
        return None
    value = np.array([np.mean([v for v, _ in own]) for own in logs.values()])
    error = np.array([math.sqrt(sum(e * e for _, e in own)) / len(own) for own in logs.values()])
    middle, apart, spread = random_effects(value, error)
    n = len(value)
    half = float(t.ppf(0.5 + 0.5 * confidence, n - 1)) * apart if n > 1 else float("nan")

    def shown(center: float, reach: float) -> Estimate:
        ends = (center, center - reach, center + reach)
        return Estimate(*(10.0**e for e in ends)) if logarithmic else Estimate(*ends)

    own = tuple(
        sessions[0] if len(sessions) == 1 else shown(v, 0.5 * sigmas * e)
        for sessions, v, e in zip(exact.values(), value, error, strict=True)
    )
    return Group(tuple(logs), own, logarithmic, shown(middle, half), spread)


def random_effects(values: Array, errors: Array) -> tuple[float, float, float]:
    """Return mean, its standard error, and the standard deviation between people.

    Parameters
    ----------
    values : (n,) array
        Estimates.
    errors : (n,) array
        Their standard errors, above 0.
    """
    errors = np.maximum(errors, 1e-12)
    n = len(values)
    if n == 1:
        return float(values[0]), float(errors[0]), float("nan")

    def scatter(variance: float) -> tuple[float, float, float]:
        weights = 1.0 / (errors**2 + variance)
        mean = float(weights @ values / weights.sum())
        return mean, float(weights @ (values - mean) ** 2), float(weights.sum())

    variance = 0.0
    if scatter(0.0)[1] > n - 1:
        top = float(np.var(values, ddof=1)) * n + 1e-12
        while scatter(top)[1] > n - 1:
            top *= 2.0
        variance = float(brentq(lambda v: scatter(v)[1] - (n - 1), 0.0, top))
    mean, squares, weight = scatter(variance)
    return mean, math.sqrt(squares / (n - 1) / weight), math.sqrt(variance)


def compare(groups: dict[str, Group], confidence: float = 0.95) -> list[PairedComparison]:
    """Return each pair of conditions compared within the people who took part in both.

    Pairs that fewer than two people took part in are left out.

    Parameters
    ----------
    groups : dict of Group by condition
        Of one measure.
    confidence : float
    """
    found: list[PairedComparison] = []
    for (first, one), (second, other) in itertools.combinations(groups.items(), 2):
        both = [name for name in one.participants if name in other.participants]
        if len(both) < 2:
            continue
        a, b = (
            np.array([g.estimates[g.participants.index(name)].value for name in both])
            for g in (one, other)
        )
        apart = np.log10(b / a) if one.logarithmic else b - a
        found.append(_compared(first, second, apart, one.logarithmic, confidence))
    return [
        PairedComparison(**{**vars(one), "p_holm": p})
        for one, p in zip(found, holm([one.p for one in found]), strict=True)
    ]


def _compared(
    first: str, second: str, apart: Array, logarithmic: bool, confidence: float
) -> PairedComparison:
    n = len(apart)
    mean, sd = float(np.mean(apart)), float(np.std(apart, ddof=1))
    statistic = mean / (sd / math.sqrt(n)) if sd > 0.0 else math.copysign(math.inf, mean)
    if sd == mean == 0.0:  # nobody differs
        statistic = 0.0
    half = float(t.ppf(0.5 + 0.5 * confidence, n - 1)) * sd / math.sqrt(n)
    ends = (mean, mean - half, mean + half)
    effect = Estimate(*(10.0**e for e in ends)) if logarithmic else Estimate(*ends)
    size = statistic / math.sqrt(n)
    low, high = noncentrality(statistic, n - 1, confidence)
    correction = math.exp(gammaln((n - 1) / 2) - gammaln((n - 2) / 2)) / math.sqrt((n - 1) / 2)
    p = float(2.0 * t.sf(abs(statistic), n - 1))
    return PairedComparison(
        first, second, n, effect, logarithmic, statistic, p, p,
        Estimate(size, low / math.sqrt(n), high / math.sqrt(n)),
        size * correction if n > 2 else float("nan"),
    )  # fmt: skip


def noncentrality(statistic: float, freedom: int, confidence: float) -> tuple[float, float]:
    """Return the interval of the noncentrality parameter of a t statistic."""
    if not math.isfinite(statistic):
        return float("nan"), float("nan")
    tail, ends = 0.5 * (1.0 - confidence), []
    for side, part in ((-1.0, 1.0 - tail), (1.0, tail)):

        def beyond(center: float, part: float = part) -> float:
            # SciPy's function is not a number far from the centre, where it is 0.
            return float(np.nan_to_num(nct.cdf(statistic, freedom, center))) - part

        far = statistic + side
        while side * beyond(far) > 0.0:
            far = statistic + 1.5 * (far - statistic)
        ends.append(brentq(beyond, statistic, far))
    return float(ends[0]), float(ends[1])


def holm(ps: list[float]) -> list[float]:
    """Return p values corrected by Holm's method for their number."""
    order = sorted(range(len(ps)), key=lambda i: ps[i])
    out, highest = list(ps), 0.0
    for place, i in enumerate(order):
        highest = max(highest, min(1.0, (len(ps) - place) * ps[i]))
        out[i] = highest
    return out


def plain(values: Any) -> list[float | None]:
    """Return numbers for JSON; None for those that are not finite."""
    return [float(v) if np.isfinite(v) else None for v in values]


def spanned(estimate: Any) -> dict[str, float | None]:
    """Return a value with the ends of its interval for JSON."""
    return dict(zip(("value", "low", "high"), plain(estimate), strict=True))
