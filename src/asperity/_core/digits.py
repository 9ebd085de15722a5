"""Numbers for readers: no more digits than are read, no fewer than a verdict needs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SMALL = 1e-4
"""Below it, zeros behind the point are harder to count than a power of ten is to read."""
MOST = 8
"""Significant digits beyond which two numbers count as equal."""


def telling(values: Sequence[float], limits: Sequence[float] = (), *, digits: int = 3) -> list[str]:
    """Return numbers with as many significant digits as a reader needs to judge them.

    Each number, as written, is above or below the next one and each limit as the number itself
    is: 0.0503 against a limit of 0.05 is not written as 0.05.

    Parameters
    ----------
    values : sequence of float
    limits : sequence of float
        With which each value is compared.
    digits : int
        Fewest significant digits, 1 to 8.
    """
    for count in range(digits, MOST):
        written = [_rounded(value, count) for value in values]
        beside = all(
            _order(*exact) == _order(*shown)
            for exact, shown in zip(pairwise(values), pairwise(written), strict=True)
        )
        if beside and all(
            _order(exact, limit) == _order(shown, limit)
            for exact, shown in zip(values, written, strict=True)
            for limit in limits
        ):
            return [plain_number(value, count) for value in values]
    return [plain_number(value, MOST) for value in values]


def plain_number(value: float, digits: int = 3) -> str:
    """Return a number of so many significant digits, thousands apart; a power of ten if tiny."""
    rounded = _rounded(value, digits)
    if rounded == 0.0 or not math.isfinite(rounded):
        return f"{rounded:g}"
    power = math.floor(math.log10(abs(rounded)))
    if abs(rounded) < _SMALL:
        return f"{rounded / 10.0**power:.{digits}g} × 10{str(power).translate(SUPERSCRIPTS)}"
    decimals = max(digits - 1 - power, 0)
    text = f"{rounded:,.{decimals}f}".replace(",", "\u202f")
    return text.rstrip("0").rstrip(".") if decimals else text


def _rounded(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")


def _order(first: float, second: float) -> int:
    return int(first > second) - int(first < second)
