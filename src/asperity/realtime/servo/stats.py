"""Statistics of a loop: counts and histograms, all allocated before it begins.

A histogram has bins of equal width in the logarithm of time, `PER_OCTAVE` per doubling, so that a
quantile is accurate to 2.2 % (half a bin); the largest value is kept exactly.
"""

from __future__ import annotations

import math
from typing import Any

PER_OCTAVE = 16
LOWEST = 1e-7
"""Upper edge of the first bin [s]."""
_BINS = 27 * PER_OCTAVE
"""Number of bins, up to 13 s."""
QUANTILES = {"p50": 0.5, "p95": 0.95, "p99": 0.99, "p999": 0.999}
LATENESS = tuple(2.0**k * 1e-6 for k in range(17))
"""Upper edges of the reported bins of lateness [s]: 1 us to 66 ms."""
STAGES = ("read", "contact_wait", "tool", "passivity", "write", "publish", "tick")
"""Stages of a tick, and `tick`, the whole."""


class Histogram:
    """A histogram of durations with logarithmic bins."""

    def __init__(self) -> None:
        self._counts = [0] * (_BINS + 1)
        self._none = (0,) * (_BINS + 1)
        self.count = 0
        self.largest = 0.0

    def add(self, seconds: float) -> None:
        """Count one duration [s]."""
        if seconds > self.largest:
            self.largest = seconds
        at = 0
        if seconds > LOWEST:
            at = min(int(PER_OCTAVE * math.log2(seconds / LOWEST)) + 1, _BINS)
        self._counts[at] += 1
        self.count += 1

    def clear(self) -> None:
        """Reset to empty, in the same memory."""
        self._counts[:] = self._none
        self.count, self.largest = 0, 0.0

    def quantile(self, share: float) -> float:
        """Return the quantile of the durations at `share` [s], to half a bin; 0 if empty."""
        if self.count == 0:
            return 0.0
        wanted, total, at = share * self.count, self._counts[0], 0
        while total < wanted:
            at += 1
            total += self._counts[at]
        middle: float = LOWEST * 2.0 ** ((at - 0.5) / PER_OCTAVE)
        return min(middle, self.largest)

    def below(self, seconds: float) -> int:
        """Return how many durations are at most `seconds` [s], to a bin."""
        if seconds >= self.largest:
            return self.count
        last = max(int(PER_OCTAVE * math.log2(seconds / LOWEST)), 0)
        return sum(self._counts[: last + 1])

    def quantiles_us(self) -> dict[str, float]:
        """Return quantiles and the largest duration in microseconds."""
        summary = {name: round(self.quantile(share) * 1e6, 2) for name, share in QUANTILES.items()}
        return {**summary, "max": round(self.largest * 1e6, 2)}


class Recent:
    """The 99th percentile of the durations of each full second."""

    def __init__(self) -> None:
        self.p99 = 0.0
        """Of the last full second [s]; 0 before the first."""
        self._now = Histogram()
        self._until = math.inf

    def add(self, seconds: float, now: float) -> None:
        """Count one duration [s] that ended at `now` [s]."""
        if not now < self._until:
            self.p99 = self._now.quantile(0.99)
            self._now.clear()
            self._until = now + 1.0
        elif self._until == math.inf:
            self._until = now + 1.0
        self._now.add(seconds)


class Stats:
    """Counts and durations of a loop.

    `ticks` counts those done; `misses` those finished after their deadline or never begun because
    an earlier one took too long (`skipped`); `fallbacks` those whose contact was an older one,
    extrapolated; `cut_short` those in which a search ran out of time, so that its depth is not
    certified.
    """

    def __init__(self) -> None:
        self.ticks = 0
        self.misses = 0
        self.skipped = 0
        self.fallbacks = 0
        self.longest_fallback = 0
        """Largest number of consecutive fallbacks."""
        self._fallbacks_in_a_row = 0
        self.cut_short = 0
        self.passivity = 0
        """Ticks in which the passivity controller changed the wrench."""
        self.stages = {name: Histogram() for name in STAGES}
        self.lateness = Histogram()
        """Delays of the ticks' beginnings."""
        self.contact = Histogram()
        """Durations of contacts."""
        self.recent_tick, self.recent_contact = Recent(), Recent()

    def finished(
        self, *, skipped: int, late: float, missed: bool, fallback: bool, cut_short: bool = False
    ) -> None:
        """Count one tick."""
        self.ticks += 1
        self.skipped += skipped
        self.misses += skipped + missed
        self.cut_short += cut_short
        self.lateness.add(late)
        if fallback:
            self.fallbacks += 1
            self._fallbacks_in_a_row += 1
            if self._fallbacks_in_a_row > self.longest_fallback:
                self.longest_fallback = self._fallbacks_in_a_row
        else:
            self._fallbacks_in_a_row = 0

    def summary(self) -> dict[str, Any]:
        """Return the statistics for `summary.json`."""
        due = self.ticks + self.skipped
        share = 100.0 / max(due, 1)
        before, bins = 0, {}
        for edge in LATENESS:
            total = self.lateness.below(edge)
            bins[f"{edge * 1e6:.0f}"] = total - before
            before = total
        bins["beyond"] = self.lateness.count - before
        return {
            "ticks": self.ticks,
            "ticks_due": due,
            "misses": self.misses,
            "misses_percent": share * self.misses,
            "ticks_skipped": self.skipped,
            "fallbacks": self.fallbacks,
            "fallbacks_percent": share * self.fallbacks,
            "longest_fallback_ticks": self.longest_fallback,
            "cut_short": self.cut_short,
            "cut_short_percent": share * self.cut_short,
            "passivity_ticks": self.passivity,
            "start_late_us": self.lateness.quantiles_us(),
            "start_late_histogram_us": bins,
            "contact_us": self.contact.quantiles_us(),
            "stages_us": {name: stage.quantiles_us() for name, stage in self.stages.items()},
        }
