"""Settings of a session that all methods share: breaks, taking back, order, catch trials."""

from __future__ import annotations

from dataclasses import dataclass

from asperity.errors import require_between, require_choice


@dataclass(frozen=True)
class SessionSettings:
    """How a session goes on between trials.

    Parameters
    ----------
    break_every : int
        Trials (adjustments) between two breaks; 0: no breaks.
    break_seconds : float
        Shortest duration of a break [s]; it ends when the participant goes on.
    take_back : bool
        Whether the participant may take back the last answer, before the next trial begins.
        Impossible once feedback was given.
    order : {"random", "balanced"}
        Of stimuli and of intervals: drawn for each participant, or balanced over participants by
        the number at the end of their codes.
    """

    break_every: int = 0
    break_seconds: float = 60.0
    take_back: bool = False
    order: str = "random"

    def __post_init__(self) -> None:
        require_between("break_every", self.break_every, 0, 100000)
        require_between("break_seconds", self.break_seconds, 0.0, 3600.0, "s")
        require_choice("order", self.order, ("random", "balanced"))

    @property
    def balanced(self) -> bool:
        """Whether orders are balanced over participants."""
        return self.order == "balanced"


@dataclass(frozen=True)
class CatchSettings:
    """Catch trials, whose answer is plain to who attends to the task.

    Parameters
    ----------
    every : int
        Of so many other trials one catch trial stands before a random one; 0: none.
    level : float, optional
        Default: the highest level.
    """

    every: int = 0
    level: float | None = None

    def __post_init__(self) -> None:
        require_between("every", self.every, 0, 100000)
