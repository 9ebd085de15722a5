"""Published findings as code: source, sureness, simulated condition and criterion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from asperity.studies.literature.laboratory import Laboratory
    from asperity.studies.literature.measures import Measure


class Sureness(Enum):
    """How the content of the source is known."""

    SEED = "as Otaduy & Lin (2004) report it"
    READ = "in the source's abstract, which was read"
    RECALLED = "recalled; not checked against the source"


@dataclass(frozen=True)
class Source:
    """A publication."""

    authors: str
    year: int
    venue: str
    doi: str = ""
    """Given only if it was seen on the publisher's page."""

    @property
    def short(self) -> str:
        """Authors (the first of several) and year."""
        first, *more = self.authors.split(", ")
        return f"{first} et al. ({self.year})" if more else f"{self.authors} ({self.year})"


class Verdict(NamedTuple):
    """Result of a finding under one metric."""

    holds: bool | None
    """None if it could not be judged; `note` gives the reason."""
    measured: dict[str, Any]
    """The numbers on which the criterion is based, as plain numbers and lists."""
    note: str = ""


Judge = Callable[["Laboratory", "Measure"], Verdict]


@dataclass(frozen=True)
class Finding:
    """A published finding about people, the condition that simulates it, and its criterion."""

    id: str
    title: str
    people: str
    """The finding of the source."""
    sources: tuple[Source, ...]
    where: str
    """Section or figure."""
    sureness: Sureness
    condition: str
    """The simulated condition. Numbers are asperity's unless stated otherwise."""
    criterion: str
    """The criterion by which it comes out. Thresholds are asperity's."""
    judge: Judge
    before: bool = True
    """Whether the criterion was written before its outcome was known."""
    caveat: str = ""
    """Limits of the result."""
    any_metric: bool = False
    """Whether the verdict is independent of the metric."""
    by_construction: bool = False
    """Whether the model cannot fail it: it is shown, and counts for no share."""
    later: bool = False
    """Whether it was added after the search for one hand and metric, which never saw it."""
