"""Settings of an experiment: its presentation and its methods, each a table of the TOML file."""

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
    """Two intervals, a standard and a comparison: which has more of the attribute in question.

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
    practice : int
        Trials at the highest level, before the others, that are not analysed.
    feedback : bool
        Whether the participant learns if the answer was right.
    """

    standard: float
    low: float
    high: float
    level: str = "weber"
    direction: str = "up"
    more: str = "larger"
    scale: str = "log"
    adaptive: str = "staircase"
    practice: int = 0
    feedback: bool = False

    def __post_init__(self) -> None:
        require_choice("level", self.level, ("weber", "difference", "value"))
        require_choice("direction", self.direction, ("up", "down"))
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

    @property
    def signed(self) -> bool:
        """Whether levels lie on both sides of the standard.

        Then it is not asked how often the answer is right, but how often the comparison has more.
        """
        return self.low < (self.standard if self.level == "value" else 0.0) < self.high

    @property
    def guess(self) -> float | None:
        """Rate at which the target is answered by chance; None: the lapse rate."""
        return None if self.signed else 0.5

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
        if self.level == "value":
            return level
        apart = level * self.standard if self.level == "weber" else level
        return self.standard + (apart if self.direction == "up" else -apart)

    def has_more(self, value: float, other: float) -> bool | None:
        """Return whether a value has more of the attribute than another; None if they are equal."""
        return None if value == other else (value > other) == (self.more == "larger")

    @property
    def comparison_is_target(self) -> bool:
        """Whether answering with the comparison gets more frequent as the level rises."""
        return bool(self.has_more(self.comparison(self.high), self.comparison(self.low)))


@dataclass(frozen=True)
class ConstantSettings:
    """The method of constant stimuli: each level `repeats` times, in random order."""

    levels: tuple[float, ...]
    repeats: int = 32

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
