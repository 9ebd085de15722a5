"""Questions and answers in the terminal, while the scene is rendered on a device."""

from __future__ import annotations

import math
import os
import select
import sys
import time
from collections.abc import Callable
from typing import TextIO

from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.interfaces.protocol import (
    ParticipantInterface,
    Paused,
    Progress,
    Reply,
    TakenBack,
)
from asperity.psychophysics.session.trials import PresentedInterval, Trial
from asperity.psychophysics.texts import read_texts

_QUIT = ("q", "quit", "pause")
_BACK = ("b", "back")


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
        self._texts = read_texts()
        self._self_paced = False
        self._practice: bool | None = None

    def welcome(self, design: ExperimentDesign, progress: Progress) -> None:
        """Show the instructions."""
        self._question, self._self_paced = design.question, design.presentation.self_paced
        self._texts = texts = design.texts
        self._say("", design.name, "", *design.instructions.strip().splitlines(), "")
        if progress.resumed:
            self._say(texts("resumed", done=progress.done))
        self._say(texts("keys"))
        if design.session.take_back:
            self._say(texts("keys_take_back"))
        if design.method in ("adjustment", "matching"):
            self._say(texts("keys_adjust"))

    def ready(self, trial: Trial, progress: Progress) -> None:
        """Wait for Enter, or for the letter that takes back the last answer."""
        texts = self._texts
        if trial.practice and self._practice is None:
            self._say(texts("practice_begins"))
        elif not trial.practice and self._practice:
            self._say(texts("practice_over"))
        self._practice = trial.practice
        if trial.step is None or trial.step == 1:
            self._say(texts("trial", number=progress.done + 1, most=progress.most))
        self._go_on(texts("enter_begins"), progress)

    def _go_on(self, prompt: str, progress: Progress) -> None:
        """Wait for Enter; raise if the last answer is to be taken back."""
        while self._line(prompt).lower() in _BACK:
            if progress.can_take_back:
                raise TakenBack
            self._say(self._texts("not_taken_back"))

    def begun(self, interval: int) -> None:
        """Show which interval has begun."""
        ends = f", {self._texts('enter_ends')}" if self._self_paced else ""
        self._say(f"  >>> {interval} <<<  {self._texts('feel_terminal')}{ends}")

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
        self._say(f"  {self._texts('interval_over', number=interval)}")

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
        self._say(f"  {self._texts('right' if right else 'wrong')}")

    def rest(self, seconds: float, progress: Progress) -> None:
        """Wait for Enter, again if it comes before the break is over."""
        end = self._clock() + seconds
        self._say("", self._texts("break"))
        while True:
            left = end - self._clock()
            if left > 0.0:
                self._say(self._texts("break_left", seconds=math.ceil(left)))
            self._line(self._texts("enter_goes_on"))
            if self._clock() >= end:
                return

    def taken_back(self) -> None:
        """Show that the last answer was taken back."""
        self._say(f"  {self._texts('taken_back')}")

    def last(self, progress: Progress) -> None:
        """Wait for Enter, or for the letter that takes back the last answer."""
        self._say(self._texts("last"))
        self._go_on(self._texts("last_terminal"), progress)

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
