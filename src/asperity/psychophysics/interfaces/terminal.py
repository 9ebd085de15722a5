"""Questions and answers in the terminal, while the scene is rendered on a device."""

from __future__ import annotations

import os
import select
import sys
import time
from collections.abc import Callable
from typing import TextIO

from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.interfaces.protocol import ParticipantInterface, Paused, Progress, Reply
from asperity.psychophysics.session.trials import PresentedInterval, Trial

_QUIT = ("q", "quit", "pause")


class TerminalInterface(ParticipantInterface):
    """Writes prompts to one stream and reads answers from another.

    Parameters
    ----------
    read, write : text streams
        Default: those of the process.
    clock : callable
        Time now [s].
    """

    kind = "terminal"

    def __init__(
        self, read: TextIO | None = None, write: TextIO | None = None, *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self._read, self._write = read or sys.stdin, write or sys.stdout
        self._clock = clock
        self._question = ""
        self._self_paced = False
        self._practice: bool | None = None

    def welcome(self, design: ExperimentDesign, progress: Progress) -> None:
        """Show the instructions."""
        self._question, self._self_paced = design.question, design.presentation.self_paced
        self._say("", design.name, "", *design.instructions.strip().splitlines(), "")
        if progress.resumed:
            self._say(f"The session goes on after {progress.done} answers.")
        self._say("At any prompt, q pauses; the same command goes on from there.")

    def ready(self, trial: Trial, progress: Progress) -> None:
        """Wait for Enter."""
        if trial.practice and self._practice is None:
            self._say("These first trials are for practice.")
        elif not trial.practice and self._practice:
            self._say("Practice is over.")
        self._practice = trial.practice
        self._line(f"Trial {progress.done + 1} of at most {progress.most}. Enter begins: ")

    def begun(self, interval: int) -> None:
        """Show which interval has begun."""
        enough = ", Enter ends it" if self._self_paced else ""
        self._say(f"  >>> {interval} <<<  feel it now{enough}")

    def done(self) -> bool:
        """Return whether Enter was pressed."""
        if os.name != "posix":
            return False
        try:
            waiting, _, _ = select.select([self._read], [], [], 0.0)
        except (OSError, ValueError, TypeError):  # a stream that select cannot poll
            return False
        if waiting:
            self._line("")
        return bool(waiting)

    def ended(self, interval: int) -> None:
        """Show that the interval has ended."""
        self._say(f"  {interval} is over")

    def ask(self, trial: Trial, felt: list[PresentedInterval]) -> Reply:
        """Ask the question and read a line."""
        begun = self._clock()
        text = self._line(f"{self._question} ")
        return Reply(text, self._clock() - begun)

    def refuse(self, why: str) -> None:
        """Show why the answer is not valid."""
        self._say(f"  {why}")

    def feedback(self, right: bool) -> None:
        """Show whether the answer was right."""
        self._say("  right" if right else "  wrong")

    def over(self, message: str) -> None:
        """Show the last message."""
        self._say(message)

    def _say(self, *lines: str) -> None:
        print(*lines, sep="\n", file=self._write, flush=True)

    def _line(self, prompt: str) -> str:
        print(prompt, end="", file=self._write, flush=True)
        line = self._read.readline()
        if not line or line.strip().lower() in _QUIT:
            raise Paused
        return line.strip()
