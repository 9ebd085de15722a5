"""Sessions read from their folders, for analysis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError
from asperity.psychophysics.design import ExperimentDesign, parse_design
from asperity.psychophysics.interfaces.protocol import SIMULATED
from asperity.psychophysics.session.journal import FILE, read_journal
from asperity.psychophysics.session.tables import answers_table
from asperity.psychophysics.session.trials import Answer, Trial, standing_answers


@dataclass(frozen=True)
class AnsweredTrial:
    """A trial and its answer."""

    trial: Trial
    answer: Answer
    right: bool | None
    seconds: float
    measures: tuple[dict[str, float], ...]
    """Measures of the exploration of each interval."""

    @property
    def hit(self) -> bool | None:
        """Whether the answer is the trial's target; None where there is none."""
        return self.trial.is_target(self.answer)


@dataclass(frozen=True)
class SessionResult:
    """One session: all answers except those of practice and catch trials."""

    participant: str
    number: int
    design: ExperimentDesign
    digest: str
    answers: tuple[AnsweredTrial, ...]
    complete: bool
    simulated: bool
    catch: tuple[AnsweredTrial, ...] = ()
    """Answers to catch trials."""
    taken_back: int = 0
    """Number of answers that were taken back."""
    rows: tuple[dict[str, Any], ...] = ()
    """Of `answers.csv`, with practice."""

    @property
    def name(self) -> str:
        """Name of the session in files and legends."""
        return f"{self.participant}-{self.number}"


def read_results(folder: Path) -> list[SessionResult]:
    """Return the sessions in a folder, or in folders below it, all of one experiment.

    Sessions that a machine answered are left out where there are people's.

    Raises
    ------
    AsperityError
        There is no session, or there are several experiments.
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
        if other.digest != first.digest:
            raise AsperityError(
                f"{place} belongs to another experiment, or another version of it, than "
                f"{places[0]}; analyse them separately"
            )
    people = [result for result in results if not result.simulated]
    # What a machine answered never counts as data of people.
    results = people if any(result.answers for result in people) else results
    answered = [result for result in results if result.answers]
    if not answered:
        raise AsperityError(f"{folder} has no answered trials other than practice")
    return answered


def read_conditions(folders: Sequence[Path]) -> dict[str, list[SessionResult]]:
    """Return the sessions of several experiments, each a condition, by its name.

    The name is the experiment's, or where two share one that of the folder.

    Raises
    ------
    AsperityError
        As `read_results`, or two folders have the same name.
    """
    read = [read_results(folder) for folder in folders]
    names = [results[0].design.name for results in read]
    if len(set(names)) < len(names):
        names = [folder.resolve().name for folder in folders]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise AsperityError(f"two conditions are named {name!r}; give their files a name each")
    return dict(zip(names, read, strict=True))


def _result(folder: Path) -> SessionResult:
    events = read_journal(folder)
    if not events or events[0]["event"] != "begin":
        raise AsperityError(f"{folder}: its journal does not begin as a session does")
    begin = events[0]
    given = standing_answers(events)
    answers = [
        AnsweredTrial(
            Trial.from_json(event["trial"]), event["answer"], event["right"],
            event["response_seconds"],
            tuple(dict(interval["measures"]) for interval in event["intervals"]),
        )
        for event in given
    ]  # fmt: skip
    return SessionResult(
        begin["participant"], begin["session"],
        parse_design(_stored(begin["document"]), folder, begin.get("name", "experiment")),
        begin["design"], tuple(a for a in answers if a.trial.counts),
        events[-1]["event"] == "end", any(event["by"] == SIMULATED for event in given),
        tuple(a for a in answers if a.trial.catch),
        sum(event["taken_back"] for event in given),
        tuple(answers_table(events)),
    )  # fmt: skip


def _stored(document: dict[str, Any]) -> dict[str, Any]:
    """Return a document without its language, whose own texts may be elsewhere by now."""
    out = {key: value for key, value in document.items() if key not in ("language", "texts")}
    for key in ("instructions", "question"):
        if isinstance(out.get(key), dict):
            out[key] = next(iter(out[key].values()), "")
    return out


ENOUGH = 0.8
"""Part of the catch trials below which a session is pointed out; a project choice."""


def catch_summary(results: Sequence[SessionResult]) -> list[dict[str, Any]]:
    """Return the catch trials of each session that had any, and how many were right."""
    return [
        {
            "session": result.name, "trials": len(result.catch),
            "right": sum(bool(answered.right) for answered in result.catch),
        }
        for result in results if result.catch
    ]  # fmt: skip
