"""Settings of an experiment: presentation, session, catch trials and methods, each a TOML table."""

from __future__ import annotations

import math
from dataclasses import dataclass

from asperity.errors import AsperityError, require_between, require_choice, require_positive

ADAPTIVE = ("staircase", "quest+", "constant")


@dataclass(frozen=True)
class Presentation:
    """How stimuli are presented.

    Parameters
    ----------
    seconds : float
        Duration of an interval [s]; the longest one if `self_paced`.
    pause : float
        Between two intervals of a trial [s].
    self_paced : bool
        Whether the participant may end an interval early.
    show : bool
        Whether the page shows texture and plots to the participant.
    hand : bool
        Whether, without a device, a compliant simulated hand holds the tool.
    """

    seconds: float = 3.0
    pause: float = 0.5
    self_paced: bool = False
    show: bool = False
    hand: bool = False

    def __post_init__(self) -> None:
        require_between("seconds", self.seconds, 0.05, 600.0, "s")
        require_between("pause", self.pause, 0.0, 60.0, "s")


@dataclass(frozen=True)
class MagnitudeSettings:
    """Magnitude estimation, with a free modulus: any number above 0, in proportion.

    Parameters
    ----------
    blocks : int
        Number of blocks; each presents every stimulus once in a random order.
    practice : int
        Trials before the first block that are not analysed.
    """

    blocks: int = 3
    practice: int = 0

    def __post_init__(self) -> None:
        require_between("blocks", self.blocks, 1, 1000)
        require_between("practice", self.practice, 0, 1000)


@dataclass(frozen=True)
class ForcedChoiceSettings:
    """A comparison and one or two standards: which has more of the attribute in question.

    Parameters
    ----------
    standard : float
        Value of the levels' key.
    low, high : float
        Smallest and largest level.
    level : {"weber", "difference", "value"}
        What a level is: the comparison is `standard (1 + level)`, `standard + level`, or `level`.
    direction : {"up", "down"}
        With "down" the comparison is `standard (1 - level)` or `standard - level`.
    more : {"larger", "smaller"}
        Whether the larger or the smaller value has more of the attribute.
    scale : {"log", "linear"}
        Of the levels: steps are factors, or differences.
    adaptive : {"staircase", "quest+", "constant"}
    intervals : int
        2, or 3 with two standards.
    practice : int
        Trials at the highest level, before the others, that are not analysed.
    feedback : bool
        Whether the participant learns if the answer was right.
    practice_feedback : bool
        The same, of practice trials.
    """

    standard: float
    low: float
    high: float
    level: str = "weber"
    direction: str = "up"
    more: str = "larger"
    scale: str = "log"
    adaptive: str = "staircase"
    intervals: int = 2
    practice: int = 0
    feedback: bool = False
    practice_feedback: bool = True

    def __post_init__(self) -> None:
        require_standard(self.standard, self.level, self.direction)
        require_choice("more", self.more, ("larger", "smaller"))
        require_choice("scale", self.scale, ("log", "linear"))
        require_choice("adaptive", self.adaptive, ADAPTIVE)
        require_between("practice", self.practice, 0, 1000)
        if not self.low < self.high:
            raise AsperityError(f"low ({self.low:g}) must be below high ({self.high:g})")
        if self.scale == "log":
            require_positive("low", self.low)
        nought = self.standard if self.level == "value" else 0.0
        if self.high <= nought:
            raise AsperityError(
                f"all levels up to high ({self.high:g}) lie below the standard, and get easier as "
                'they fall: give how far below as level = "difference" with direction = "down"'
            )
        if self.signed and self.direction == "down":
            raise AsperityError(
                'levels on both sides of the standard have direction = "up"; got "down" '
                f"with low {self.low:g}, high {self.high:g}"
            )
        self._check_intervals()

    def _check_intervals(self) -> None:
        require_between("intervals", self.intervals, 2, 3)
        if self.intervals == 3 and self.signed:
            raise AsperityError(
                "with 3 intervals all levels lie on one side of the standard, or two of the "
                f"intervals may have more; got low {self.low:g}, high {self.high:g}"
            )
        if self.intervals == 3 and not self.comparison_is_target:
            raise AsperityError(
                "with 3 intervals the comparison must have more than the two standards; got "
                f'direction = "{self.direction}", more = "{self.more}"'
            )

    @property
    def signed(self) -> bool:
        """Whether levels lie on both sides of the standard.

        Then it is not asked how often the answer is right, but how often the comparison has more.
        """
        return self.low < (self.standard if self.level == "value" else 0.0) < self.high

    @property
    def guess(self) -> float | None:
        """Rate at which the target is answered by chance; None: the lapse rate."""
        return None if self.signed else 1.0 / self.intervals

    def intensity(self, level: float) -> float:
        """Return the intensity of a level: its decimal logarithm on a logarithmic scale."""
        return math.log10(level) if self.scale == "log" else level

    def level_of(self, intensity: float) -> float:
        """Return the level of an intensity, clipped to `low` and `high`."""
        # Limited against overflow; the result is clipped to `high` anyway.
        level = 10.0 ** min(intensity, 300.0) if self.scale == "log" else intensity
        return float(f"{min(max(level, self.low), self.high):.9g}")

    def comparison(self, level: float) -> float:
        """Return the value of the comparison at a level."""
        return comparison_value(self.standard, level, self.level, self.direction)

    def has_more(self, value: float, other: float) -> bool | None:
        """Return whether a value has more of the attribute than another; None if they are equal."""
        return None if value == other else (value > other) == (self.more == "larger")

    @property
    def comparison_is_target(self) -> bool:
        """Whether answering with the comparison gets more frequent as the level rises."""
        return bool(self.has_more(self.comparison(self.high), self.comparison(self.low)))


@dataclass(frozen=True)
class OddOneOutSettings(ForcedChoiceSettings):
    """Three intervals, two of them equal: which one is different.

    As `ForcedChoiceSettings`; `more` only names what the comparison has more of.

    Parameters
    ----------
    odd : {"either", "comparison"}
        Which of the two values is presented once. With "comparison" whoever notices that may choose
        the one that has more, instead of the different one.
    """

    intervals: int = 3
    odd: str = "either"

    def _check_intervals(self) -> None:
        require_choice("odd", self.odd, ("either", "comparison"))
        require_between("intervals", self.intervals, 3, 3)
        if self.signed:
            raise AsperityError(
                "levels of odd-one-out lie on one side of the standard; got "
                f"low {self.low:g}, high {self.high:g}"
            )


@dataclass(frozen=True)
class YesNoSettings:
    """One interval, the standard or a comparison: was the signal there.

    Parameters
    ----------
    standard : float
        Value of the levels' key without the signal.
    levels : tuple of float
        Of the signal.
    level, direction
        As of `ForcedChoiceSettings`.
    repeats : int
        Trials of each level.
    without : int, optional
        Trials of the standard. Default: as many as those of all levels together.
    practice : int
        Trials before the others, half of them at the highest level, that are not analysed.
    feedback, practice_feedback : bool
        As of `ForcedChoiceSettings`.
    """

    standard: float
    levels: tuple[float, ...]
    level: str = "weber"
    direction: str = "up"
    repeats: int = 100
    without: int | None = None
    practice: int = 0
    feedback: bool = False
    practice_feedback: bool = True

    def __post_init__(self) -> None:
        require_standard(self.standard, self.level, self.direction)
        require_between("repeats", self.repeats, 1, 10000)
        require_between("practice", self.practice, 0, 1000)
        if self.without is not None:
            require_between("without", self.without, 1, 100000)
        if not self.levels or len(set(self.levels)) < len(self.levels):
            raise AsperityError(f"levels must hold different numbers, got {list(self.levels)}")
        for level in self.levels:
            if self.comparison(level) == self.standard:
                raise AsperityError(f"levels: at {level:g} there is no signal, but the standard")

    def comparison(self, level: float) -> float:
        """Return the value of the signal at a level."""
        return comparison_value(self.standard, level, self.level, self.direction)

    @property
    def highest(self) -> float:
        """The level farthest from the standard."""
        return max(self.levels, key=lambda level: abs(self.comparison(level) - self.standard))

    @property
    def trials_without(self) -> int:
        """Number of trials of the standard."""
        return self.repeats * len(self.levels) if self.without is None else self.without


def require_standard(standard: float, level: str, direction: str) -> None:
    """Raise `AsperityError` unless levels of this kind lead away from the standard."""
    require_choice("level", level, ("weber", "difference", "value"))
    require_choice("direction", direction, ("up", "down"))
    if standard == 0.0 and level == "weber":
        raise AsperityError(
            'a standard of 0 has no fractions: give level = "difference" or "value", got "weber"'
        )


def comparison_value(standard: float, level: float, kind: str, direction: str) -> float:
    """Return the value of a comparison at a level; see `ForcedChoiceSettings`."""
    if kind == "value":
        return level
    apart = level * standard if kind == "weber" else level
    return standard + (apart if direction == "up" else -apart)


@dataclass(frozen=True)
class ConstantSettings:
    """The method of constant stimuli: each level `repeats` times, in random order."""

    levels: tuple[float, ...]
    repeats: int = 40

    def __post_init__(self) -> None:
        if len(self.levels) < 2:
            raise AsperityError(f"levels must hold at least two values, got {len(self.levels)}")
        require_between("repeats", self.repeats, 1, 10000)

    @property
    def most(self) -> int:
        """Number of trials."""
        return self.repeats * len(self.levels)


@dataclass(frozen=True)
class PairsSettings:
    """Paired comparison: every pair of stimuli, in both orders.

    Parameters
    ----------
    repeats : int
        Presentations of each pair; even numbers balance the two orders.
    practice : int
        Trials before the others that are not analysed.
    """

    repeats: int = 2
    practice: int = 0

    def __post_init__(self) -> None:
        require_between("repeats", self.repeats, 1, 1000)
        require_between("practice", self.practice, 0, 1000)


@dataclass(frozen=True)
class RankingSettings:
    """Ranking: all stimuli in each trial, put in order.

    Parameters
    ----------
    repeats : int
    practice : int
        Trials before the others that are not analysed.
    """

    repeats: int = 3
    practice: int = 0

    def __post_init__(self) -> None:
        require_between("repeats", self.repeats, 1, 1000)
        require_between("practice", self.practice, 0, 1000)


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
