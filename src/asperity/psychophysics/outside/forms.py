"""Known forms of tables: three public data sets, and PsychoPy's wide CSV."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from asperity.errors import AsperityError

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Form:
    """A table's form: how it is recognised and what its columns mean."""

    name: str
    has: tuple[str, ...]
    """Columns by which it is recognised."""
    mapping: Mapping[str, list[str]]
    """Name in `METHODS`, or `condition` -> columns."""
    only: Mapping[str, str] = field(default_factory=dict)
    """Column -> the value of the rows that hold what is wanted."""
    words: Mapping[str, str] = field(default_factory=dict)

    def fits(self, table: pd.DataFrame) -> bool:
        """Return whether a table has the form."""
        return set(self.has) <= set(table.columns)


FORMS = (
    Form(
        "ViPer: ratings through a tool of steel", ("category", "sample", "subject", "roughtness"),
        {"participant": ["subject"], "stimulus": ["sample"], "rating": ["roughtness"]},
        words={"stimulus": "materials"},
    ),
    Form(
        "ratings at four speeds", ("material", "speed_text", "rough", "rec_start"),
        {"stimulus": ["material"], "condition": ["speed_text"], "rating": ["rough"]},
        words={"stimulus": "materials", "condition": "speeds"},
    ),
    Form(
        "foot and hand", ("Texture", "Condition", "Metric", "Rating", "Participant"),
        {
            "participant": ["Participant"], "stimulus": ["Texture"], "condition": ["Condition"],
            "rating": ["Rating"],
        },
        only={"Metric": "roughness"}, words={"stimulus": "materials"},
    ),
)  # fmt: skip
"""`roughtness` is how the data set spells it."""

_OWN = ("participant", "session", "date", "expName", "psychopyVersion", "frameRate", "expStart")


def psychopy_mapping(
    path: Path, columns: list[str], given: Mapping[str, list[str]]
) -> dict[str, list[str]]:
    """Return the mapping of PsychoPy's wide CSV: what is given, and the rest by its names.

    A slider's answer is the one column that ends in `.response`, an answer by key in `.keys`; the
    stimulus is the one column of the conditions' file, whose names have no dot. Where there are
    several, `--columns` has to name one.
    """
    mapping = dict(given)
    if "participant" not in mapping and "participant" in columns:
        mapping["participant"] = ["participant"]
    pair = {"first", "second"} <= {*mapping, *columns}
    wanted, ending = ("chosen", ".keys") if pair else ("rating", ".response")
    if wanted not in mapping and "rank" not in mapping:
        mapping[wanted] = [_only(path, wanted, [c for c in columns if c.endswith(ending)])]
    if not pair and "stimulus" not in mapping:
        own = [
            c for c in columns
            if "." not in c and c not in _OWN and not c.startswith("Unnamed")
            and [c] not in mapping.values()
        ]  # fmt: skip
        mapping["stimulus"] = [_only(path, "stimulus", own)]
    return mapping


def _only(path: Path, wanted: str, candidates: list[str]) -> str:
    if len(candidates) != 1:
        which = f"one of {', '.join(candidates[:8])}" if candidates else "a column"
        raise AsperityError(f"{path}: say which column is the {wanted}: --columns {wanted}={which}")
    return candidates[0]
