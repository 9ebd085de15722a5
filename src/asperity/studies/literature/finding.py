"""What a published finding is, as code: where it stands, how sure it is, and how it is judged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from asperity.studies.literature.laboratory import Laboratory
    from asperity.studies.literature.measures import Measure


class Sureness(Enum):
    """How it is known what the source says."""

    SEED = "as Otaduy & Lin (2004) report it"
    READ = "in the source's abstract, which was read"
    RECALLED = "recalled; not checked against the source"


@dataclass(frozen=True)
class Source:
    """A publication, and what of it could be read."""

    authors: str
    year: int
    venue: str
    doi: str = ""
    """Only where it was seen on the publisher's page."""

    @property
    def short(self) -> str:
        """Authors, the first of many, and year."""
        first, *more = self.authors.split(", ")
        return f"{first} et al. ({self.year})" if more else f"{self.authors} ({self.year})"


class Verdict(NamedTuple):
    """How a finding came out for one metric."""

    holds: bool | None
    """None: could not be judged; `note` says why."""
    measured: dict[str, Any]
    """What the criterion was read off; plain numbers and lists."""
    note: str = ""


Judge = Callable[["Laboratory", "Measure"], Verdict]


@dataclass(frozen=True)
class Finding:
    """A published finding about people, the condition that simulates it, and its criterion."""

    id: str
    title: str
    people: str
    """What people did or said: the source's, not ours."""
    sources: tuple[Source, ...]
    where: str
    """Section or figure."""
    sureness: Sureness
    condition: str
    """What is simulated. Numbers are ours unless it says otherwise."""
    criterion: str
    """When it is said to come out. Thresholds are ours."""
    judge: Judge
    before: bool = True
    """Whether the criterion was written before its outcome was known."""
    caveat: str = ""
    """Why it may mean less than it seems to."""
    any_metric: bool = False
    """Whether the verdict is the same whatever the metric."""
