"""What sessions left, read for analysis."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError
from asperity.psychophysics.design import ExperimentDesign, design_of
from asperity.psychophysics.session.journal import FILE, read_journal
from asperity.psychophysics.session.trials import Answer, Trial


@dataclass(frozen=True)
class Given:
    """A trial and its answer."""

    trial: Trial
    answer: Answer
    right: bool | None
    seconds: float
    measures: tuple[dict[str, float], ...]
    """Of what was felt in each interval."""


@dataclass(frozen=True)
class SessionResult:
    """One session: all answers, without those of practice."""

    participant: str
    number: int
    design: ExperimentDesign
    mark: str
    given: tuple[Given, ...]
    complete: bool
    simulated: bool

    @property
    def name(self) -> str:
        """For files and legends."""
        return f"{self.participant}-{self.number}"


def read_results(folder: Path) -> list[SessionResult]:
    """Return the sessions in a folder, or in folders below it, all of one experiment.

    Raises
    ------
    AsperityError
        There is none, or there are several experiments.
    """
    if not folder.is_dir():
        raise AsperityError(
            f"no such folder: {folder}; give the folder of a session, or of several"
        )
    places = (
        [folder]
        if (folder / FILE).is_file()
        else [path.parent for path in sorted(folder.glob(f"*/{FILE}"))]
    )
    if not places:
        raise AsperityError(f"no session in {folder}; give the folder of a session, or of several")
    results = [_result(place) for place in places]
    first = results[0]
    for place, other in zip(places, results, strict=True):
        if other.mark != first.mark:
            raise AsperityError(
                f"{place} is of another experiment, or of another state of it, than {places[0]}; "
                "analyse them apart"
            )
    answered = [result for result in results if result.given]
    if not answered:
        raise AsperityError(f"no trial of {folder} was answered, but for practice")
    return answered


def _result(folder: Path) -> SessionResult:
    events = read_journal(folder)
    if not events or events[0]["event"] != "begin":
        raise AsperityError(f"{folder}: its journal does not begin as a session does")
    begin = events[0]
    given, by = [], set()
    for event in events:
        if event["event"] != "answer":
            continue
        by.add(event["by"])
        trial = Trial.from_plain(event["trial"])
        if not trial.practice:
            given.append(_given(trial, event))
    return SessionResult(
        begin["participant"], begin["session"], design_of(begin["document"], folder),
        begin["design"], tuple(given), events[-1]["event"] == "end", "simulated" in by,
    )  # fmt: skip


def _given(trial: Trial, event: dict[str, Any]) -> Given:
    measures = tuple(dict(interval["measures"]) for interval in event["intervals"])
    return Given(trial, event["answer"], event["right"], event["response_seconds"], measures)
