"""A session of an experiment: trial after trial, each answer on the disk before the next.

What a session leaves in its folder:

    experiment.toml    the design, as it was
    journal.jsonl      every event; the one file from which all else follows
    answers.csv        a row for each answer
    trials.csv         a row for each interval that was presented
    recordings/        NUMBER-INTERVAL.h5: every tick of it

With the same design, participant and session number it goes on where it was: the journal is read,
each answer is given to the procedure again, and the trial that was not answered is presented anew.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from asperity import __version__
from asperity._core.output import write_whole
from asperity.errors import AsperityError, OutputError
from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.interfaces.front import Front, Paused, Progress
from asperity.psychophysics.procedures.procedures import Procedure, procedure
from asperity.psychophysics.session.journal import Journal
from asperity.psychophysics.session.presenters import Presenter, private_files
from asperity.psychophysics.session.tables import write_tables
from asperity.psychophysics.session.trials import PresentedInterval, Trial
from asperity.psychophysics.stimuli import Stimulus
from asperity.scene.document import write_toml

SCHEMA = 1
RECORDINGS = "recordings"
_CODE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}")
_CHANGED = {
    "design": "the experiment's file", "scenes": "a scene or texture that it presents",
    "participant": "the participant", "session": "the number of the session",
}  # fmt: skip


@dataclass(frozen=True)
class SessionOutcome:
    """How a run of a session ended."""

    folder: Path
    answers: int
    most: int
    complete: bool
    """Whether there are no more trials."""


def participant_code(text: str) -> str:
    """Return a participant's code, or refuse what may be more than one."""
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
        Of this session alone; made if need be. A session that is in it goes on.
    participant : str
        A code.
    number : int
        Of the session, from 1.
    now : callable
        Returns the date and time.

    Raises
    ------
    AsperityError
        There is another session in the folder, or the design or a stimulus has changed since.
    OutputError
        The folder holds something else, cannot be written, or is in use.
    """

    def __init__(
        self,
        design: ExperimentDesign,
        folder: Path,
        participant: str,
        number: int = 1,
        *,
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        self.design, self.folder, self._now = design, folder, now
        self.participant, self.number = participant_code(participant), number
        self.procedure: Procedure = procedure(design, participant, number)
        self.answers = 0
        self._attempts: dict[int, int] = {}
        if folder.is_dir() and any(folder.iterdir()) and not (folder / "journal.jsonl").exists():
            raise OutputError(f"{folder} holds something else than a session; give another --out")
        marks = {
            "design": design.mark, "scenes": design.check_scenes(),
            "participant": participant, "session": number,
        }  # fmt: skip
        with private_files():
            self.journal = Journal(folder)
            try:
                self.resumed = bool(self.journal.events)
                self._begin(marks)
            except BaseException:
                self.journal.close()
                raise

    def _begin(self, marks: dict[str, Any]) -> None:
        """Take up what is there, or begin."""
        events = self.journal.events
        if events:
            self._resume(list(events), marks)
            self.journal.append("resume", time=self._time(), version=__version__)
        else:
            self.journal.append(
                "begin", schema=SCHEMA, time=self._time(), version=__version__, **marks,
                document=self.design.document, method=self.design.method,
            )  # fmt: skip
        (self.folder / RECORDINGS).mkdir(mode=0o700, exist_ok=True)
        write_whole(self.folder / "experiment.toml", write_toml(self.design.document))
        write_tables(self.journal.events, self.folder)

    def _resume(self, events: list[dict[str, Any]], marks: dict[str, Any]) -> None:
        begin = events[0]
        if begin["event"] != "begin" or begin["schema"] != SCHEMA:
            raise AsperityError(f"{self.journal.path} does not begin as a session of this version")
        for name, mark in marks.items():
            if begin[name] != mark:
                raise AsperityError(
                    f"{self.folder} holds a session that began with another state of "
                    f"{_CHANGED[name]}; put it back as it was, or give another --out or --session"
                )
        for event in events:
            if event["event"] == "trial":
                number = event["trial"]["number"]
                self._attempts[number] = self._attempts.get(number, 0) + 1
            elif event["event"] == "answer":
                trial = Trial.from_plain(event["trial"])
                if self.procedure.next() != trial:
                    raise AsperityError(
                        f"{self.folder}: trial {trial.number} would be another one now than in the "
                        f"journal, which asperity {begin['version']} wrote; go on with that version"
                    )
                self.procedure.answer(trial, event["answer"])
                self.answers += 1

    @property
    def progress(self) -> Progress:
        """How far it is."""
        return Progress(self.answers, self.procedure.most, self.resumed)

    def run(
        self, presenter: Presenter, front: Front, *, sleep: Callable[[float], None] = time.sleep
    ) -> SessionOutcome:
        """Go through the trials that are left, or until the front end wants to pause.

        Parameters
        ----------
        presenter : Presenter
        front : Front
        sleep : callable
            Lets time go by between intervals [s].
        """
        with private_files():
            try:
                trial = self.procedure.next()
                if trial is not None:
                    front.welcome(self.design, self.progress)
                while trial is not None:
                    self.do(trial, presenter, front, sleep)
                    trial = self.procedure.next()
            except Paused:
                self.journal.append("pause", time=self._time())
                return SessionOutcome(self.folder, self.answers, self.procedure.most, False)
            finally:
                presenter.drop()
        if self.journal.events[-1]["event"] != "end":
            self.journal.append("end", time=self._time(), answers=self.answers)
        front.over(f"That was the last of {self.answers} trials. Thank you.")
        return SessionOutcome(self.folder, self.answers, self.answers, True)

    def do(
        self, trial: Trial, presenter: Presenter, front: Front, sleep: Callable[[float], None]
    ) -> None:
        """Present a trial, ask, keep the answer, and go on."""
        attempt = self._attempts.get(trial.number, 0) + 1
        wanted = [
            (stimulus, self.folder / RECORDINGS / recording_name(trial.number, i, attempt))
            for i, stimulus in enumerate(trial.stimuli, 1)
        ]
        for _, recording in wanted:
            # Of a trial that was made ready and never began: the journal does not know of it.
            recording.unlink(missing_ok=True)
        presenter.prepare(wanted, self.design.presentation.seconds)
        front.ready(trial, self.progress)
        self.journal.append("trial", time=self._time(), trial=trial.plain(), attempt=attempt)
        self._attempts[trial.number] = attempt
        felt = []
        for interval, (stimulus, recording) in enumerate(wanted, 1):
            if interval > 1:
                sleep(self.design.presentation.pause)
            felt.append(self._present(stimulus, recording, interval, presenter, front))
        answer, seconds = self._asked(trial, felt, front)
        right = trial.is_right(answer)
        self.journal.append(
            "answer", time=self._time(), trial=trial.plain(), attempt=attempt, answer=answer,
            right=right, response_seconds=round(seconds, 4), by=front.kind,
            intervals=[interval.plain() for interval in felt],
        )  # fmt: skip
        # From here on the answer is on the disk.
        self.procedure.answer(trial, answer)
        self.answers += 1
        write_tables(self.journal.events, self.folder)
        if right is not None and getattr(self.design.settings, "feedback", False):
            front.feedback(right)

    def _present(
        self, stimulus: Stimulus, recording: Path, interval: int, presenter: Presenter, front: Front
    ) -> PresentedInterval:
        felt = presenter.present(
            stimulus, recording, self.design.presentation.seconds,
            lambda: front.begun(interval),
            front.done if self.design.presentation.self_paced else lambda: False,
        )  # fmt: skip
        front.ended(interval)
        return felt

    def _asked(
        self, trial: Trial, felt: list[PresentedInterval], front: Front
    ) -> tuple[Any, float]:
        spent = 0.0
        while True:
            reply = front.ask(trial, felt)
            spent += reply.seconds
            try:
                return trial.checked(reply.answer), spent
            except AsperityError as error:
                front.refuse(str(error))

    def _time(self) -> str:
        return self._now().isoformat(timespec="milliseconds")

    def close(self) -> None:
        """Let go of the journal."""
        self.journal.close()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def recording_name(trial: int, interval: int, attempt: int) -> str:
    """Return the name of an interval's recording."""
    again = f"-attempt{attempt}" if attempt > 1 else ""
    return f"{trial:04d}-{interval}{again}.h5"
