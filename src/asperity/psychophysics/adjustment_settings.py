"""Settings of adjustment and matching: a comparison is changed until it equals a standard."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from asperity.errors import AsperityError, require_between, require_choice, require_positive


@dataclass(frozen=True)
class MatchingSettings:
    """Each standard is matched by a value of the levels' key.

    In each step the standard is presented, then the comparison; the participant answers how the
    comparison should change, or that they are equal, which ends the adjustment.

    Parameters
    ----------
    low, high : float
        Smallest and largest value of the comparison. An adjustment starts in the lowest or in the
        highest third, in turns, at a value that is drawn.
    step : float
        By how much the value changes: a factor above 1 on a logarithmic scale, a difference on a
        linear one.
    standards : tuple of float
        Values of the levels' key. Empty: the named stimuli.
    coarse : int
        Steps of a large change.
    repeats : int
        Adjustments to each standard; even numbers balance the two starts.
    scale : {"log", "linear"}
    more : {"larger", "smaller"}
        Whether the larger or the smaller value has more of the attribute.
    steps : int
        Steps after which an adjustment is given up; it is not analysed.
    practice : int
        Adjustments before the others that are not analysed.
    """

    low: float
    high: float
    step: float
    standards: tuple[float, ...] = ()
    coarse: int = 4
    repeats: int = 8
    scale: str = "log"
    more: str = "larger"
    steps: int = 40
    practice: int = 0

    def __post_init__(self) -> None:
        require_choice("scale", self.scale, ("log", "linear"))
        require_choice("more", self.more, ("larger", "smaller"))
        require_between("coarse", self.coarse, 2, 100)
        require_between("repeats", self.repeats, 1, 1000)
        require_between("steps", self.steps, 2, 1000)
        require_between("practice", self.practice, 0, 1000)
        require_positive("step", self.step)
        if not self.low < self.high:
            raise AsperityError(f"low ({self.low:g}) must be below high ({self.high:g})")
        if self.scale == "log":
            require_positive("low", self.low)
            for standard in self.standards:
                require_positive("standards", standard)
            if self.step <= 1.0:
                raise AsperityError(f"step must be a factor above 1, got {self.step:g}")
        if self.intensity(self.step) > self.intensity(self.high) - self.intensity(self.low):
            raise AsperityError(
                f"step ({self.step:g}) is larger than the range from low ({self.low:g}) to high "
                f"({self.high:g})"
            )
        if len(set(self.standards)) < len(self.standards):
            raise AsperityError(f"standards must be different numbers, got {list(self.standards)}")

    def intensity(self, value: float) -> float:
        """Return the decimal logarithm of a value on a logarithmic scale, or the value."""
        return math.log10(value) if self.scale == "log" else value

    def value_of(self, intensity: float) -> float:
        """Return the value of an intensity, clipped to `low` and `high`."""
        value = 10.0 ** min(intensity, 300.0) if self.scale == "log" else intensity
        return float(f"{min(max(value, self.low), self.high):.9g}")

    def changed(self, value: float, answer: int) -> float:
        """Return the value of the comparison after an answer, a key of `ADJUST` other than 0."""
        steps = (1 if answer > 0 else -1) * (1 if abs(answer) == 1 else self.coarse)
        towards = steps if self.more == "larger" else -steps
        return self.value_of(self.intensity(value) + towards * self.intensity(self.step))


@dataclass(frozen=True, kw_only=True)
class AdjustmentSettings(MatchingSettings):
    """A comparison is adjusted to one standard on the same axis.

    Parameters
    ----------
    standard : float
        Value of the levels' key.
    low, high, step, coarse, repeats, scale, more, steps, practice
        As of `MatchingSettings`. `repeats` is larger, since its spread is the JND.
    """

    standard: float
    standards: tuple[float, ...] = field(default=(), init=False)
    """The one."""
    repeats: int = 24

    def __post_init__(self) -> None:
        if not self.low < self.standard < self.high:
            raise AsperityError(
                f"standard ({self.standard:g}) must lie between low ({self.low:g}) and high "
                f"({self.high:g})"
            )
        object.__setattr__(self, "standards", (self.standard,))
        super().__post_init__()
