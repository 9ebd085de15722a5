"""A session of an experiment: each answer is on the disk before the next trial begins.

A session writes into its folder:

    experiment.toml    the design
    journal.jsonl      every event; the tables are derived from it, now and then and at the end
    answers.csv        a row for each answer
    trials.csv         a row for each interval that was presented
    recordings/        NUMBER-INTERVAL.h5: every tick of it

With the same design, participant and session number a session resumes: the journal is read, each
answer is passed to the procedure again, and the unanswered trial is presented again.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from asperity import __version__
from asperity._core.output import write_whole
from asperity.errors import AsperityError, OutputError
from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.interfaces.protocol import (
    SIMULATED,
    ParticipantInterface,
    Paused,
    Progress,
    TakenBack,
)
from asperity.psychophysics.procedures.procedures import Procedure, procedure
from asperity.psychophysics.session.journal import Journal
from asperity.psychophysics.session.presenters import Presenter, private_files
from asperity.psychophysics.session.tables import write_tables
from asperity.psychophysics.session.trials import PresentedInterval, Trial, standing_answers
from asperity.scene.document import write_toml
from asperity.studies.sweeps.batch import machine

SCHEMA = 1
RECORDINGS = "recordings"
_TABLES_EVERY = 30.0
"""Time between two versions of the tables while a session runs [s]."""
_CODE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}")
_CHANGED = {
    "design": "the experiment's file", "scenes": "a scene or texture that it presents",
    "participant": "the participant", "session": "the number of the session",
}  # fmt: skip


@dataclass(frozen=True)
class SessionOutcome:
    """State of a session when `Session.run` returns."""

    folder: Path
    answers: int
    done: int
    """Answers, or adjustments that have ended."""
    most: int
    complete: bool
    """Whether all trials are answered."""
    unit: str = "answers"
    """What `done` and `most` count: answers, or adjustments."""


def participant_code(text: str) -> str:
    """Return a participant's code, or raise if the text may identify a person."""
    if not _CODE.fullmatch(text):
        raise AsperityError(
            f"--participant must be a code of up to 32 letters, digits, - and _, such as P07, not "
            f"a name or an address; got {text!r}"
        )
    return text


class Session:
    """One participant's session. A context manager.

    Parameters
    ----------
    design : Design
    folder : Path
        Folder of this session only; created if missing. A session in it is resumed.
    participant : str
        A code.
    number : int
        Of the session, from 1.
    now : callable
        Returns the date and time.

    Raises
    ------
    AsperityError
        The folder holds another session, or the design or a stimulus has changed.
    OutputError
        The folder holds something else, cannot be written, or is in use.
    """

    def __init__(
        self, design: ExperimentDesign, folder: Path, participant: str, number: int = 1, *,
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:  # fmt: skip
        self.design, self.folder, self._now = design, folder, now
        self.participant, self.number = participant_code(participant), number
        self.procedure: Procedure = procedure(design, participant, number)
        self.answers = 0
        self._attempts: dict[int, int] = {}
        if folder.is_dir() and any(folder.iterdir()) and not (folder / "journal.jsonl").exists():
            raise OutputError(f"{folder} is not empty and holds no session; give another --out")
        digests = {
            "design": design.digest, "scenes": design.check_scenes(),
            "participant": participant, "session": number,
        }  # fmt: skip
        with private_files():
            self.journal = Journal(folder)
            try:
                self.resumed = bool(self.journal.events)
                self._begin(digests)
            except BaseException:
                self.journal.close()
                raise

    def _begin(self, digests: dict[str, Any]) -> None:
        """Resume the session in the folder, or begin one."""
        events = self.journal.events
        if events:
            self._resume(list(events), digests)
        else:
            self.journal.append(
                "begin", schema=SCHEMA, time=self._time(), version=__version__, **digests,
                name=self.design.name, document=self.design.document, method=self.design.method,
            )  # fmt: skip
        (self.folder / RECORDINGS).mkdir(mode=0o700, exist_ok=True)
        write_whole(self.folder / "experiment.toml", write_toml(self.design.document))
        self._write_tables()

    def _write_tables(self) -> None:
        """Make the tables from the journal, which alone counts."""
        write_tables(self.journal.events, self.folder)
        self._tables_at = time.monotonic()

    def _resume(self, events: list[dict[str, Any]], digests: dict[str, Any]) -> None:
        begin = events[0]
        if begin["event"] != "begin" or begin["schema"] != SCHEMA:
            raise AsperityError(
                f"{self.journal.path} is not the journal of a session of "
                f"this version (schema {SCHEMA})"
            )
        for name, digest in digests.items():
            if begin[name] != digest:
                raise AsperityError(
                    f"{self.folder} holds a session that began with another state of "
                    f"{_CHANGED[name]}; put it back as it was, or give another --out or --session"
                )
        for event in events:
            if event["event"] == "trial":
                number = event["trial"]["number"]
                self._attempts[number] = self._attempts.get(number, 0) + 1
        self._replay()

    def _replay(self) -> None:
        """Give all answers that were not taken back to a new procedure."""
        self.procedure = procedure(self.design, self.participant, self.number)
        standing = standing_answers(self.journal.events)
        for event in standing:
            trial = Trial.from_json(event["trial"])
            if self.procedure.next() != trial:
                raise AsperityError(
                    f"{self.folder}: trial {trial.number} would be another one now than in the "
                    f"journal, which asperity {self.journal.events[0]['version']} wrote; go on "
                    "with that version"
                )
            self.procedure.answer(trial, event["answer"])
        self.answers = len(standing)

    @property
    def progress(self) -> Progress:
        """Progress of the session."""
        return Progress(
            self.procedure.done, self.procedure.most, self.resumed, self._can_take_back()
        )

    def _can_take_back(self) -> bool:
        """Return whether the last answer stands, and nothing was said about it."""
        if not self.design.session.take_back:
            return False
        for event in reversed(self.journal.events):
            if event["event"] == "answer":
                trial = Trial.from_json(event["trial"])
                return not self._gives_feedback(trial, event["right"])
            if event["event"] == "taken_back":
                return False
        return False

    def _gives_feedback(self, trial: Trial, right: bool | None) -> bool:
        """Return whether the participant learns if the answer to a trial was right."""
        settings = self.design.settings
        shown = getattr(settings, "feedback", False) or (
            trial.practice and getattr(settings, "practice_feedback", False)
        )
        return right is not None and bool(shown) and not trial.catch

    def run(
        self, presenter: Presenter, interface: ParticipantInterface, *,
        sleep: Callable[[float], None] = time.sleep,
    ) -> SessionOutcome:  # fmt: skip
        """Run the remaining trials, or until the participant pauses.

        Parameters
        ----------
        presenter : Presenter
        interface : ParticipantInterface
        sleep : callable
            Waits between intervals [s].
        """
        trial = self.procedure.next()
        if trial is not None:
            self._refuse_mixed(interface)
        with private_files():
            try:
                if trial is not None:
                    presenter.check(trial.stimuli[0])
                    self.journal.append(
                        "run", time=self._time(), version=__version__, by=interface.kind,
                        machine=machine(), language=self.design.texts.language,
                    )  # fmt: skip
                    interface.welcome(self.design, self.progress)
                try:
                    self._run_trials(presenter, interface, sleep)
                finally:
                    self._write_tables()
            except OutputError as error:
                raise OutputError(
                    f"{error}; all {self.answers} answers are kept, and the same command resumes"
                ) from None
            except Paused:
                self.journal.append("pause", time=self._time())
                return self._outcome(complete=False)
            finally:
                presenter.drop()
        if self.journal.events[-1]["event"] != "end":
            self.journal.append("end", time=self._time(), answers=self.answers)
        interface.over(self.design.texts("over", count=self.procedure.done))
        return self._outcome(complete=True)

    def _outcome(self, *, complete: bool) -> SessionOutcome:
        done, most = self.procedure.done, self.procedure.most
        unit = "adjustments" if self.design.kind == "adjust" else "answers"
        return SessionOutcome(self.folder, self.answers, done, most, complete, unit)

    def _run_trials(
        self, presenter: Presenter, interface: ParticipantInterface, sleep: Callable[[float], None]
    ) -> None:
        """Run all remaining trials with their breaks; an answer may be taken back between them."""
        begun = self.procedure.next() is not None
        while True:
            trial = self.procedure.next()
            try:
                if trial is not None:
                    self._rest(trial, interface)
                    self.do(trial, presenter, interface, sleep)
                elif begun and self.progress.can_take_back:
                    interface.last(self.progress)
                    return
                else:
                    return
            except TakenBack:
                presenter.drop()
                if self.progress.can_take_back:
                    self.journal.append("taken_back", time=self._time(), by=interface.kind)
                    self._replay()
                    interface.taken_back()

    def _rest(self, trial: Trial, interface: ParticipantInterface) -> None:
        """Take the break that is due before a trial, or go on with an interrupted one."""
        settings, done = self.design.session, self.procedure.done
        breaks = [e for e in self.journal.events if e["event"] in ("break", "break_end")]
        left = settings.break_seconds
        if breaks and breaks[-1]["event"] == "break":
            begun = datetime.fromisoformat(breaks[-1]["time"])
            left = min(max(left - (self._now() - begun).total_seconds(), 0.0), left)
        elif (
            settings.break_every
            and trial.step in (None, 1)
            and done - (breaks[-1]["after"] if breaks else 0) >= settings.break_every
        ):
            self.journal.append("break", time=self._time(), after=done)
        else:
            return
        interface.rest(left, self.progress)
        after = [e["after"] for e in self.journal.events if e["event"] == "break"][-1]
        self.journal.append("break_end", time=self._time(), after=after)

    def _refuse_mixed(self, interface: ParticipantInterface) -> None:
        """Raise if a person is to go on with a machine's session, or the other way round."""
        for event in self.journal.events:
            if event["event"] in ("run", "answer") and (
                (event["by"] == SIMULATED) != (interface.kind == SIMULATED)
            ):
                one, other = ("a machine", "a person")[:: 1 if event["by"] == SIMULATED else -1]
                raise AsperityError(
                    f"{self.folder} is a session of {one}, in which {other} cannot answer; "
                    "give another --participant, such as TEST for --simulate, or --session"
                )

    def do(
        self, trial: Trial, presenter: Presenter, interface: ParticipantInterface,
        sleep: Callable[[float], None],
    ) -> None:  # fmt: skip
        """Present a trial, ask, and store the answer."""
        attempt = self._attempts.get(trial.number, 0) + 1
        wanted = [
            (stimulus, self.folder / RECORDINGS / recording_name(trial.number, i, attempt))
            for i, stimulus in enumerate(trial.stimuli, 1)
        ]
        for _, recording in wanted:
            # Left by a trial that was prepared but never began; the journal does not contain it.
            recording.unlink(missing_ok=True)
        presenter.prepare(wanted, self.design.presentation.seconds)
        interface.ready(trial, self.progress)
        self.journal.append("trial", time=self._time(), trial=trial.to_json(), attempt=attempt)
        self._attempts[trial.number] = attempt
        felt, shown = [], self.design.presentation
        for interval, (stimulus, recording) in enumerate(wanted, 1):
            if interval > 1:
                sleep(shown.pause)
            presented = presenter.present(
                stimulus, recording, shown.seconds, partial(interface.begun, interval),
                interface.done if shown.self_paced else lambda: False,
            )  # fmt: skip
            interface.ended(interval)
            felt.append(presented)
        answer, seconds = self._asked(trial, felt, interface)
        right = trial.is_right(answer)
        self.journal.append(
            "answer", time=self._time(), trial=trial.to_json(), attempt=attempt, answer=answer,
            right=right, response_seconds=round(seconds, 4), by=interface.kind,
            intervals=[interval.to_json() for interval in felt],
        )  # fmt: skip
        # From here on the answer is on the disk.
        self.procedure.answer(trial, answer)
        self.answers += 1
        if time.monotonic() - self._tables_at > _TABLES_EVERY:
            self._write_tables()
        if right is not None and self._gives_feedback(trial, right):
            interface.feedback(right)

    def _asked(
        self, trial: Trial, felt: list[PresentedInterval], interface: ParticipantInterface
    ) -> tuple[Any, float]:
        spent = 0.0
        while True:
            reply = interface.ask(trial, felt)
            spent += reply.seconds
            try:
                return trial.parse_answer(reply.answer, self.design.texts), spent
            except AsperityError as error:
                interface.refuse(str(error))

    def _time(self) -> str:
        return self._now().isoformat(timespec="milliseconds")

    def close(self) -> None:
        """Close the journal."""
        self.journal.close()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def recording_name(trial: int, interval: int, attempt: int) -> str:
    """Return the name of an interval's recording."""
    again = f"-attempt{attempt}" if attempt > 1 else ""
    return f"{trial:04d}-{interval}{again}.h5"
