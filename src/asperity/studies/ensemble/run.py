"""Runs the ensemble on several processes; the result is a table of booleans.

One task is one plate: its slope tables do not depend on the hand, so that all hands share them.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError
from asperity.studies.ensemble.members import EnsembleSettings
from asperity.studies.ensemble.processes import over_items
from asperity.studies.ensemble.questions import PAPER_CLAIMS, PEOPLE_CLAIMS, PlateClaim
from asperity.studies.literature.laboratory import Laboratory, Plan, Tables
from asperity.studies.literature.measures import COLUMNS, PAPER, Measure
from asperity.studies.literature.plates import Dots, Sinusoids

METRIC_NAMES = tuple(COLUMNS)
"""The metrics of question (b); question (a) has the first alone."""


@dataclass(frozen=True)
class Answer:
    """The answer to one question: which member gets which claim, under which metric."""

    claims: tuple[PlateClaim, ...]
    metrics: tuple[str, ...]
    hands: tuple[Hand, ...]
    plates: tuple[Sinusoids | Dots, ...]
    holds: NDArray[np.bool_]
    """Shape (hands, plates, metrics, claims)."""

    @property
    def shares(self) -> NDArray[np.float64]:
        """The share of members in which each claim holds, shape (metrics, claims)."""
        return np.asarray(self.holds.mean(axis=(0, 1)))

    @property
    def counted(self) -> NDArray[np.bool_]:
        """Which claims count, shape (claims,): those that the model can fail."""
        return np.array([not claim.by_construction for claim in self.claims])

    def median_count(self, metric: str) -> float:
        """Return the median over members of how many counted claims hold under a metric."""
        rows = self.holds[:, :, self.metrics.index(metric)][..., self.counted]
        return float(np.median(rows.sum(axis=-1)))

    def of_hand(self, hand: Hand, plate: Sinusoids | Dots) -> NDArray[np.bool_]:
        """Return the verdicts of one member, shape (metrics, claims)."""
        return np.asarray(self.holds[self.hands.index(hand), self.plates.index(plate)])


@dataclass(frozen=True)
class EnsembleResult:
    """The answers to both questions."""

    paper: Answer
    people: Answer


def run_ensemble(
    settings: EnsembleSettings | None = None,
    *,
    processes: int | None = None,
    progress: Callable[[], None] | None = None,
) -> EnsembleResult:
    """Judge every claim for every member of the ensemble.

    Parameters
    ----------
    settings : EnsembleSettings, optional
        Defaults as in the class.
    processes : int, optional
        As for `over_items`.
    progress : callable, optional
        Called after each plate.
    """
    settings = settings or EnsembleSettings()
    waves, dots = settings.sinusoids(), settings.dots()
    # Plates of dots take longest: they go first, so that no process waits for the last one.
    plates: list[Sinusoids | Dots] = [*dots, *waves]
    found = over_items(
        functools.partial(_judge_plate, settings=settings), plates, processes=processes,
        progress=progress,
    )  # fmt: skip
    split, hands = len(dots), settings.hands

    def answer(
        claims: tuple[PlateClaim, ...],
        metrics: tuple[str, ...],
        kept: Sequence[Sinusoids | Dots],
        parts: list[NDArray[np.bool_]],
    ) -> Answer:
        empty = np.zeros((len(hands), 0, len(metrics), len(claims)), dtype=bool)
        holds = np.stack(parts, axis=1) if parts else empty
        return Answer(claims, metrics, hands, tuple(kept), holds)

    return EnsembleResult(
        answer(PAPER_CLAIMS, METRIC_NAMES[:1], waves, found[split:]),
        answer(PEOPLE_CLAIMS, METRIC_NAMES, dots, found[:split]),
    )


def _judge_plate(plate: Sinusoids | Dots, settings: EnsembleSettings) -> NDArray[np.bool_]:
    """Return the verdicts of all hands on one plate, shape (hands, metrics, claims)."""
    is_wave = isinstance(plate, Sinusoids)
    claims = PAPER_CLAIMS if is_wave else PEOPLE_CLAIMS
    measures: tuple[Measure, ...] = (PAPER,) if is_wave else tuple(COLUMNS.values())
    plan = Plan(spacings=settings.sinusoid_spacings if is_wave else settings.dot_spacings)
    tables: Tables = {}
    holds = np.zeros((len(settings.hands), len(measures), len(claims)), dtype=bool)
    for i, hand in enumerate(settings.hands):
        lab = Laboratory(hand, plan, tables=tables, measures=measures)
        for j, measure in enumerate(measures):
            for k, claim in enumerate(claims):
                try:
                    curves = lab.curves(measure, plate, plan.touches(claim.factor))
                except AsperityError:
                    continue  # A hand that cannot be dragged gets no claim.
                holds[i, j, k] = bool(claim.rule(plan.places, curves).holds)
    return holds
