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


_OWN = "[OL] 4.2"
_PLATE_1, _PLATE_2, _PLATE_3 = "colour plate 1", "colour plate 2", "colour plate 3"
PAPER_CLAIMS = (
    PlateClaim("diameter.quadratic", "Quadratic over spacing in log-log", f"{_OWN}, {_PLATE_1}",
               "diameter", quadratic_fits),
    PlateClaim("diameter.peak_higher", "A smaller probe has a higher peak", f"{_OWN}, {_PLATE_1}",
               "diameter", criteria.peaks_fall_with),
    PlateClaim("diameter.peak_smaller_spacing", "A smaller probe peaks at a smaller spacing",
               f"{_OWN}, {_PLATE_1}", "diameter", criteria.peaks_move_right),
    PlateClaim("force.more_everywhere", "More force gives more, at every spacing",
               f"{_OWN}, {_PLATE_2}", "force", criteria.rises_everywhere, by_construction=True),
    PlateClaim("force.peak_stays", "More force hardly moves the peak", f"{_OWN}, {_PLATE_2}",
               "force", criteria.peaks_stay),
    PlateClaim("speed.faster_at_large", "Faster gives more at 2.5 mm", f"{_OWN}, {_PLATE_3}",
               "speed", criteria.rises_at_large),
    PlateClaim("speed.faster_at_largest", "Faster gives more at 3.5 mm", f"{_OWN}, {_PLATE_3}",
               "speed", rises_at_largest),
    PlateClaim("speed.peak_moves_right", "A faster probe peaks at a larger spacing",
               f"[OL] 3.1, {_PLATE_3}: of people; the text does not say it of the simulation",
               "speed", criteria.peaks_move_right),
    PlateClaim("speed.constant_at_small", "At 0.5 mm nearly constant with speed (its own failure)",
               f"{_OWN}: the failure that the paper reports", "speed", constant_at_small),
)  # fmt: skip
"""The nine of question (a): over sinusoids, by max u''."""

_PEOPLE = {
    "diameter": "[OL] 3.1, after Lederman et al. (2000)",
    "force": "[OL] 3.1, after Lederman et al. (2000)",
    "speed": "[OL] 3.1, after Lederman et al. (1999)",
}
PEOPLE_CLAIMS = (
    PlateClaim("diameter.inverted_u", "An inverted U over spacing",
               "[OL] 3.1, after Klatzky & Lederman (1999)", "diameter", criteria.inverted_u),
    PlateClaim("diameter.peak_higher", "A smaller probe is rougher at its peak",
               _PEOPLE["diameter"], "diameter", criteria.peaks_fall_with),
    PlateClaim("diameter.peak_smaller_spacing", "A smaller probe peaks at a smaller spacing",
               _PEOPLE["diameter"], "diameter", criteria.peaks_move_right),
    PlateClaim("force.more_everywhere", "More force is rougher, at every spacing",
               _PEOPLE["force"], "force", criteria.rises_everywhere, by_construction=True),
    PlateClaim("force.peak_stays", "More force hardly moves the peak", _PEOPLE["force"], "force",
               criteria.peaks_stay),
    PlateClaim("speed.faster_at_large", "Faster is rougher at large spacing", _PEOPLE["speed"],
               "speed", criteria.rises_at_large),
    PlateClaim("speed.slower_at_small", "Slower is rougher at small spacing", _PEOPLE["speed"],
               "speed", criteria.falls_at_small),
    PlateClaim("speed.peak_moves_right", "A faster probe peaks at a larger spacing",
               _PEOPLE["speed"], "speed", criteria.peaks_move_right),
)  # fmt: skip
"""The eight of question (b): over jittered dots, by every metric."""
