"""Every part that the paper leaves out, switched on and off over the whole ensemble.

A design is a model and a metric: whether the probe may lift off, whether the finger is judged by
the pressure on its skin, and how vibration becomes one number (a band, a channel of the skin, all
channels pooled, with or without the tissue before them). Every design judges the same findings for
the same hands and plates as `halves`; findings that the model cannot fail are judged as well, so
that they can be shown, and count for nothing. Nothing is chosen here, and nothing was fitted.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity._core.data import table_beside
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.studies.ensemble.halves import (
    PLATES,
    Design,
    counted_findings,
    judge_designs,
)
from asperity.studies.ensemble.members import ensemble_hands
from asperity.studies.ensemble.processes import as_texts, from_texts
from asperity.studies.literature.catalogue import FINDINGS
from asperity.studies.literature.finding import Finding
from asperity.studies.literature.fit import as_json
from asperity.studies.literature.halves_page import chosen_measure, read_published_halves
from asperity.studies.literature.measures import COLUMNS, PAPER, Measure
from asperity.studies.literature.plates import Dots
from asperity.studies.skin.channels import CHANNELS

SPEED_BY_FINGER = ("finger.speed", "finger.groove_over_rate", "finger.textures")
"""Findings that the pressure on the skin cannot fail, since it knows no speed."""
PUBLISHED = Path(__file__).with_name("published_parts.json")


def designs() -> dict[str, Design]:
    """Return the designs by name: the metrics of the paper's model, and each part alone and all."""
    band, pooled = COLUMNS["band_rms"], Measure("pooled", transmission=True)
    metrics = {"paper": PAPER, "band": band, "chosen": chosen_measure()}
    for kind in (*CHANNELS, "summed", "pooled"):
        metrics |= {kind: Measure(kind), f"{kind}_tissue": Measure(kind, transmission=True)}
    found = {name: Design(measure) for name, measure in metrics.items()}
    for name in ("paper", "band", "chosen", "pooled_tissue"):
        found[f"{name}_lift"] = Design(metrics[name], lift_off=True)
    for name, measure in (("band", band), ("pooled_tissue", pooled)):
        found[f"{name}_skin"] = Design(measure, skin=True)
        found[f"{name}_lift_skin"] = Design(measure, lift_off=True, skin=True)
    return found


def judged_findings() -> tuple[Finding, ...]:
    """Return the findings that count, and after them those that the model cannot fail."""
    return (*counted_findings(), *(finding for finding in FINDINGS if finding.by_construction))


@dataclass(frozen=True)
class PartsTable:
    """Which member gets which finding, under which design."""

    findings: tuple[Finding, ...]
    designs: dict[str, Design]
    hands: tuple[Hand, ...]
    plates: tuple[Dots, ...]
    holds: NDArray[np.bool_]
    """Shape (hands, plates, designs, findings)."""

    def of(self, design: str) -> NDArray[np.bool_]:
        """Return the verdicts under one design, shape (hands, plates, findings)."""
        return np.asarray(self.holds[:, :, list(self.designs).index(design)])

    def share(self, design: str, finding: str) -> float:
        """Return the share of the members in which a finding comes out."""
        ids = [one.id for one in self.findings]
        return float(self.of(design)[..., ids.index(finding)].mean())

    def counts(self, design: str) -> NDArray[np.bool_]:
        """Return which findings count under a design: those that its model can fail."""
        no_speed = self.designs[design].skin
        return np.array([
            not one.by_construction and not (no_speed and one.id in SPEED_BY_FINGER)
            for one in self.findings
        ])  # fmt: skip

    def median(
        self,
        design: str,
        kept: Callable[[Finding], bool] = lambda _: True,
        *,
        beside: str | None = None,
    ) -> float:
        """Return the median over members of the share of counted findings that come out.

        Parameters
        ----------
        design : str
        kept : callable
            Whether a finding is among those whose share is taken.
        beside : str, optional
            Another design, under which the findings must count as well.
        """
        mask = self.counts(design) & self.counts(beside or design)
        mask &= np.array([kept(one) for one in self.findings])
        return float(np.median(self.of(design)[..., mask].mean(axis=-1)))


def by_finger(finding: Finding) -> bool:
    """Return whether a finding is about a bare finger, alone or beside a probe."""
    return finding.id.startswith("finger.") or finding.id in {
        "gratings.groove", "textures.alike", "probe.smoothest",
    }  # fmt: skip


def judge_parts(
    chosen: dict[str, Design] | None = None,
    *,
    hands: Sequence[Hand] | None = None,
    findings: tuple[Finding, ...] | None = None,
    plates: tuple[Dots, ...] = PLATES,
    processes: int | None = None,
    progress: Callable[[], None] | None = None,
) -> PartsTable:
    """Judge findings for every hand, plate and design; `progress` is called after every hand."""
    chosen = chosen or designs()
    hands = tuple(hands or ensemble_hands())
    findings = findings or judged_findings()
    tried = tuple(chosen.values())
    holds = judge_designs(tried, hands, findings, plates, processes, progress)
    return PartsTable(findings, chosen, hands, plates, holds)


def parts_document(table: PartsTable) -> dict[str, Any]:
    """Return the table ready for JSON: every verdict, a text of 0 and 1 for design and finding."""
    ids = [finding.id for finding in table.findings]
    return {
        "schema": 1,
        "hands": [asdict(hand) for hand in table.hands],
        "plates": [asdict(plate) for plate in table.plates],
        "order": "hands, then plates",
        "designs": {
            name: as_json(design.measure) | {"lift_off": design.lift_off, "skin": design.skin}
            for name, design in table.designs.items()
        },
        "holds": as_texts(table.holds, table.designs, ids),
    }  # fmt: skip


def read_parts(path: Path = PUBLISHED) -> PartsTable:
    """Return the table of a file, by default the shipped one, as `parts_document` stores it."""
    stored = json.loads(path.read_text("utf-8"))
    tried = designs()
    by_name = {finding.id: finding for finding in FINDINGS}
    hands = tuple(Hand(**one) for one in stored["hands"])
    plates = tuple(Dots(**one) for one in stored["plates"])
    kept = {name: tried[name] for name in stored["holds"]}
    ids = list(next(iter(stored["holds"].values())))
    holds = from_texts(stored["holds"], len(hands), len(plates))
    return PartsTable(tuple(by_name[one] for one in ids), kept, hands, plates, holds)


PAIRS = [tuple(pair) for pair in table_beside(__file__, "parts.toml")["pairs"]]
"""Each part: by which metric it is judged, the design without it and the design with it."""
CHANGED = 0.2
"""Least difference of two shares of the ensemble that is named."""


def parts_summary(table: PartsTable) -> dict[str, Any]:
    """Return the numbers of the documentation's page.

    Returns
    -------
    dict
        Counts of members, hands and counted findings, heights of the plates [m]; findings that a
        finger with skin cannot fail; `share`, of the
        members that get a finding, by design and finding; `median`, of the counted findings that a
        member gets, by design, over all, those of a probe and those of a finger; and for each pair
        of `PAIRS` its names, these medians without and with the part, over what counts in both
        designs, and the findings that the part gains and loses; `choice`, as `choose_design`
        returns it; and `by_damping`, the share by design, finding and damping of the hand.
    """
    ids = [finding.id for finding in table.findings]
    share = {name: {one: table.share(name, one) for one in ids} for name in table.designs}
    kinds = {
        "all": lambda _: True, "finger": by_finger, "probe": lambda one: not by_finger(one)
    }  # fmt: skip

    def medians(design: str, beside: str) -> dict[str, float]:
        return {kind: table.median(design, kept, beside=beside) for kind, kept in kinds.items()}

    def pair(part: str, by: str, without: str, added: str) -> dict[str, Any]:
        both = table.counts(without) & table.counts(added)
        counted = [one for one, counts in zip(ids, both, strict=True) if counts]
        gain = {one: share[added][one] - share[without][one] for one in counted}
        return {
            "part": part, "by": by,
            "without": medians(without, added), "with": medians(added, without),
            "gained": [one for one in counted if gain[one] >= CHANGED],
            "lost": [one for one in counted if gain[one] <= -CHANGED],
        }  # fmt: skip

    return {
        "members": len(table.hands) * len(table.plates), "hands": len(table.hands),
        "plates": [plate.height for plate in table.plates],
        "counted": int(table.counts("band").sum()), "free_with_skin": list(SPEED_BY_FINGER),
        "share": share,
        "median": {name: medians(name, name) for name in table.designs},
        "pairs": [pair(*names) for names in PAIRS],
        "choice": choose_design(table),
        "by_damping": {
            design: {one: _by_damping(table, design, one) for one in ids}
            for design in ("paper", "band")
        },
    }  # fmt: skip


def _by_damping(table: PartsTable, design: str, finding: str) -> dict[str, float]:
    """Return the share of the members that get a finding, by the damping of the hand."""
    at = [one.id for one in table.findings].index(finding)
    holds = table.of(design)[..., at]
    damping = np.array([hand.damping for hand in table.hands])
    return {f"{b:g}": float(holds[damping == b].mean()) for b in sorted(set(damping.tolist()))}


def choose_design(table: PartsTable) -> dict[str, Any]:
    """Return the design that gets most of the first half of the findings, and what it gets.

    The halves are those of `halves`, and so is the rule: the largest median over members, of equal
    ones the largest mean. Findings that one of the designs cannot fail are left out for all.
    """
    halves = read_published_halves()["halves"]
    fair = np.all([table.counts(name) for name in table.designs], axis=0)
    masks = {
        half: fair & np.array([one.id in names for one in table.findings])
        for half, names in halves.items()
    }
    first = {name: table.of(name)[..., masks["first"]].mean(axis=-1) for name in table.designs}
    best = max(first, key=lambda name: (float(np.median(first[name])), float(first[name].mean())))

    def medians(name: str) -> dict[str, float]:
        return {
            half: float(np.median(table.of(name)[..., mask].mean(axis=-1)))
            for half, mask in masks.items()
        }

    return {
        "designs": len(table.designs), "name": best,
        "findings": {half: int(mask.sum()) for half, mask in masks.items()},
        "shares": {name: medians(name) for name in dict.fromkeys((best, "band", "paper"))},
    }  # fmt: skip
