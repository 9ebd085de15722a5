"""Answers of people in one form, whatever table they came from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError

if TYPE_CHECKING:
    import pandas as pd

METHODS = {
    "magnitude": ("participant", "stimulus", "rating"),
    "choice": ("participant", "first", "second", "chosen"),
    "ranking": ("participant", "trial", "stimulus", "rank"),
}
"""The methods, and the columns that each needs; `condition` may be added to all of them."""


@dataclass(frozen=True)
class Answers:
    """Answers of one kind."""

    method: str
    """A key of `METHODS`."""
    table: pd.DataFrame
    """Columns as in `METHODS`, and `condition` (empty where there is none); one row an answer."""
    form: str = "table"
    """What the table was recognised as."""
    notes: tuple[str, ...] = ()
    """What was left out or guessed."""
    words: dict[str, str] = field(default_factory=dict)
    """What stimuli and conditions are called: `materials`, `speeds`."""

    @property
    def participants(self) -> list[str]:
        """The people, sorted."""
        return sorted(set(self.table["participant"]))

    @property
    def stimuli(self) -> list[str]:
        """The stimuli, in natural order."""
        names = ("first", "second") if self.method == "choice" else ("stimulus",)
        return natural_order({value for name in names for value in self.table[name]})

    @property
    def conditions(self) -> list[str]:
        """The conditions, in natural order; one empty text if there are none."""
        return natural_order(set(self.table["condition"]))

    @property
    def cells(self) -> list[tuple[str, str]]:
        """The pairs of stimulus and condition that have answers, in natural order."""
        if self.method == "choice":
            kept = {
                cell
                for name in ("first", "second")
                for cell in zip(self.table[name], self.table["condition"], strict=True)
            }
        else:
            kept = set(zip(self.table["stimulus"], self.table["condition"], strict=True))
        return [(s, c) for c in self.conditions for s in self.stimuli if (s, c) in kept]

    def described(self) -> str:
        """Return what was read, in words."""
        parts = [
            _count(len(self.stimuli), self.words.get("stimulus", "stimuli")),
            _count(len(self.participants), "people"),
        ]
        if len(self.conditions) > 1:
            parts.append(_count(len(self.conditions), self.words.get("condition", "conditions")))
        kinds = {"magnitude": "ratings", "choice": "choices", "ranking": "ranks"}
        parts.append(_count(len(self.table), kinds[self.method]))
        return ", ".join(parts)

    def orders(self) -> list[list[int]]:
        """Return choices or rankings as rows of indices into `cells`, the one with most first."""
        index = {cell: i for i, cell in enumerate(self.cells)}
        if self.method == "choice":
            return [
                [index[w, c], index[loser, c]]
                for first, second, w, c in self.table[
                    ["first", "second", "chosen", "condition"]
                ].itertuples(index=False)
                for loser in (second if w == first else first,)
            ]
        if self.method == "ranking":
            groups = self.table.groupby(["participant", "trial", "condition"], sort=True)
            return [
                [
                    index[s, c]
                    for s, c in group.sort_values("rank")[["stimulus", "condition"]].itertuples(
                        index=False
                    )
                ]
                for _, group in groups
            ]
        raise AsperityError("magnitude estimates have no orders; ask for their matrix")

    def matrix(self) -> Array:
        """Return mean ratings (people, cells), on each person's own scale; NaN: none."""
        if self.method != "magnitude":
            raise AsperityError(f"{self.method} answers have no ratings; ask for their orders")
        people, cells = self.participants, self.cells
        means = self.table.groupby(["participant", "stimulus", "condition"])["rating"].mean()
        found = np.full((len(people), len(cells)), np.nan)
        for (person, stimulus, condition), value in means.items():
            found[people.index(person), cells.index((stimulus, condition))] = value
        return found


def natural_order(names: set[str]) -> list[str]:
    """Return names in order, numbers by their value."""

    def key(name: str) -> tuple[int, float, str]:
        try:
            return (0, float(name), name)
        except ValueError:
            return (1, 0.0, name)

    return sorted(names, key=key)


def _count(n: int, what: str) -> str:
    one = {"people": "person", "stimuli": "stimulus"}.get(what, what.removesuffix("s"))
    return f"{n} {one if n == 1 else what}"
