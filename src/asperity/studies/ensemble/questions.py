"""Two questions, kept apart, and the claims of each.

(a) *Does the paper's analysis reproduce?* Its model, its sinusoid, its metric (max u''): nine
claims of Otaduy & Lin (2004), among them the failure that they report themselves.
(b) *Does the model predict people?* On jittered dots, the plates that people touched, for every
metric: eight findings on the three colour plates.

A claim that the model cannot fail is *by construction*, and is not counted: Eq. 6 has the normal
force as a factor, so that more force gives more, whatever the hand.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from asperity._core.data import table_beside
from asperity.studies.literature import criteria
from asperity.studies.literature.finding import Verdict
from asperity.studies.otaduy_lin_2004.claims import LEAST_R_SQUARED, NEARLY_CONSTANT
from asperity.studies.otaduy_lin_2004.peak_fit import fit_quadratic

Curves = NDArray[np.float64]


@dataclass(frozen=True)
class PlateClaim:
    """A claim on the curves of one factor: probe diameter, normal force or speed."""

    id: str
    text: str
    source: str
    factor: str
    rule: Callable[[Curves, Curves], Verdict]
    by_construction: bool = False
    """Whether the model cannot fail it."""


def quadratic_fits(spacing: Curves, curves: Curves) -> Verdict:
    """Judge: a quadratic in log-log fits each curve with R^2 of at least 0.9."""
    if not np.all(curves > 0.0):
        return Verdict(False, {}, "The metric is zero somewhere.")
    fits = [fit_quadratic(spacing, row).r_squared for row in curves]
    return Verdict(min(fits) >= LEAST_R_SQUARED, {"r_squared": fits})


def rises_at_largest(spacing: Curves, curves: Curves) -> Verdict:
    """Judge: each level gives more than the one before, at the largest spacing."""
    return Verdict(bool(np.all(np.diff(curves[:, -1]) > 0.0)), {"value": curves[:, -1].tolist()})


def constant_at_small(spacing: Curves, curves: Curves) -> Verdict:
    """Judge: at the smallest spacing the levels differ by at most 15 % of their mean."""
    at = curves[:, 0]
    spread = float(np.ptp(at) / np.mean(at)) if np.mean(at) > 0.0 else np.inf
    return Verdict(spread <= NEARLY_CONSTANT, {"spread": spread})


def _claims_of(question: str) -> tuple[PlateClaim, ...]:
    def rule(name: str) -> Callable[[Curves, Curves], Verdict]:
        found: Callable[[Curves, Curves], Verdict] = globals().get(name) or getattr(criteria, name)
        return found

    return tuple(PlateClaim(**entry | {"rule": rule(entry["rule"])}) for entry in _TABLES[question])


_TABLES = table_beside(__file__, "questions.toml")
PAPER_CLAIMS = _claims_of("paper")
"""The nine of question (a): over sinusoids, by max u''."""

PEOPLE_CLAIMS = _claims_of("people")
"""The eight of question (b): over jittered dots, by every metric."""
