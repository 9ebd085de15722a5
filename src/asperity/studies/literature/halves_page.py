"""The shipped result of choosing on half of the findings over the ensemble.

It is made by `asperity findings --halves`, in `asperity.studies.ensemble.halves`, which uses this
package; here it is shown.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from asperity.studies.literature.measures import Measure, measure_of

PUBLISHED = Path(__file__).with_name("published_halves.json")


def read_published_halves() -> dict[str, Any]:
    """Return the shipped result, as `summarise_halves` gives it."""
    found: dict[str, Any] = json.loads(PUBLISHED.read_text("utf-8"))
    return found


def chosen_measure() -> Measure:
    """Return the metric that was chosen on the first half."""
    return measure_of(read_published_halves()["chosen"])


def half_of(finding: str, halves: dict[str, Any]) -> str:
    """Return `chosen on`, `held out`, or `not counted`."""
    if finding in halves["halves"]["first"]:
        return "chosen on"
    return "held out" if finding in halves["halves"]["second"] else "not counted"
