"""The ensemble of the paper's claims as it is stored: every verdict, and the result back."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError
from asperity.studies.ensemble.processes import as_texts, from_texts
from asperity.studies.ensemble.questions import PAPER_CLAIMS, PEOPLE_CLAIMS, PlateClaim
from asperity.studies.ensemble.run import Answer, EnsembleResult
from asperity.studies.literature.plates import Dots, Sinusoids

PUBLISHED = Path(__file__).with_name("published_ensemble.json")
"""What `asperity study --ensemble` writes as members.json, for whom a minute is too long."""


def members_document(result: EnsembleResult) -> dict[str, Any]:
    """Return every verdict ready for JSON: a text of 0 and 1 for metric and claim."""
    return {"schema": 1, "order": "hands, then plates"} | {
        name: {
            "hands": [asdict(hand) for hand in answer.hands],
            "plates": [asdict(plate) for plate in answer.plates],
            "holds": as_texts(answer.holds, answer.metrics, [claim.id for claim in answer.claims]),
        }
        for name, answer in (("paper", result.paper), ("people", result.people))
    }


def read_ensemble(path: Path = PUBLISHED) -> EnsembleResult:
    """Return the result that a file holds, by default the shipped one.

    Parameters
    ----------
    path : Path
        A file as `members_document` makes it.

    Raises
    ------
    AsperityError
        If its claims are not those of this version.
    """
    stored = json.loads(path.read_text("utf-8"))
    return EnsembleResult(
        _answer(stored["paper"], PAPER_CLAIMS, Sinusoids, path),
        _answer(stored["people"], PEOPLE_CLAIMS, Dots, path),
    )


def _answer(
    stored: dict[str, Any],
    claims: tuple[PlateClaim, ...],
    kind: type[Sinusoids] | type[Dots],
    path: Path,
) -> Answer:
    hands = tuple(Hand(**one) for one in stored["hands"])
    plates = tuple(kind(**one) for one in stored["plates"])
    ids = [claim.id for claim in claims]
    for metric, by_claim in stored["holds"].items():
        if list(by_claim) != ids:
            raise AsperityError(
                f"{path}: the claims of {metric} are not those of this version; run asperity "
                "study --ensemble again"
            )
    table = from_texts(stored["holds"], len(hands), len(plates))
    return Answer(claims, tuple(stored["holds"]), hands, plates, table)
