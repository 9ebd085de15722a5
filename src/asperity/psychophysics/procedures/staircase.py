"""Adaptive staircases: transformed and weighted up-down methods.

After `down` right answers in a row the level goes down by a step, after a wrong one it goes up by
`up_ratio` steps. The level then hovers where a step down is as likely, weighed by its size, as one
up:

    p^down step = (1 - p^down) up_ratio step,  so  p = (up_ratio / (1 + up_ratio))^(1 / down)

`up_ratio` of 1 is the transformed rule (Levitt 1971, J. Acoust. Soc. Am. 49, 467-477: two down, one
up finds 70.7 % right); `down` of 1 is the weighted one (Kaernbach 1991, Percept. Psychophys. 49,
227-229: a ratio of 3 finds 75 %). The equation holds for small steps; with large ones the level
hovers elsewhere (Garcia-Perez 1998, Vision Res. 38, 1861-1881), which is why the analysis fits a
psychometric function to all answers and does not rest on the reversals alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from asperity.errors import AsperityError, require_between, require_not_negative, require_positive

DISCARDED = 4
"""Reversals that the mean of the reversals leaves out, if there are more: the way down; ours."""


@dataclass(frozen=True)
class StaircaseSettings:
    """How a staircase goes. Levels and steps are on the scale of the experiment's intensities.

    Parameters
    ----------
    start : tuple of float
        Where each of the interleaved tracks begins [level]; one value for one track.
    steps : tuple of float
        Size of a step down, in turn after each reversal, the last one for good: factors above 1
        on a logarithmic scale of levels, differences on a linear one.
    down : int
        Right answers in a row before a step down, 1 to 8.
    up_ratio : float
        Size of a step up in steps down.
    reversals : int
        A track ends after so many.
    trials : int
        Or after so many trials, whichever comes first.
    """

    start: tuple[float, ...]
    steps: tuple[float, ...]
    down: int = 2
    up_ratio: float = 1.0
    reversals: int = 12
    trials: int = 100

    def __post_init__(self) -> None:
        if not self.start or not self.steps:
            raise AsperityError("start and steps must hold a value each at least")
        for value in self.steps:
            require_positive("steps", value)
        require_between("down", self.down, 1, 8)
        require_positive("up_ratio", self.up_ratio)
        require_between("reversals", self.reversals, 1, 1000)
        require_between("trials", self.trials, 1, 10000)

    @property
    def target(self) -> float:
        """Proportion of right answers at which the level hovers."""
        return float((self.up_ratio / (1.0 + self.up_ratio)) ** (1.0 / self.down))


@dataclass
class Staircase:
    """One track: where it is, and how it came there.

    Parameters
    ----------
    start : float
        First intensity.
    steps : tuple of float
        Sizes of the step down, as intensities.
    down, up_ratio, reversals, trials
        See `StaircaseSettings`.
    low, high : float
        Intensities are held between them.
    """

    start: float
    steps: tuple[float, ...]
    down: int = 2
    up_ratio: float = 1.0
    reversals: int = 12
    trials: int = 100
    low: float = float("-inf")
    high: float = float("inf")
    intensity: float = field(init=False)
    done: int = field(init=False, default=0)
    """Answers so far."""
    turned: list[float] = field(init=False, default_factory=list)
    """Intensities of the reversals."""
    _row: int = field(init=False, default=0)
    _heading: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        for step in self.steps:
            require_not_negative("step", step)
        self.intensity = min(max(self.start, self.low), self.high)

    @property
    def is_over(self) -> bool:
        """Whether no more trials are wanted."""
        return len(self.turned) >= self.reversals or self.done >= self.trials

    def answer(self, right: bool) -> None:
        """Go on after an answer at `intensity`."""
        self.done += 1
        if not right:
            self._row = 0
            self._go(+1)
            return
        self._row += 1
        if self._row == self.down:
            self._row = 0
            self._go(-1)

    def _go(self, heading: int) -> None:
        if self._heading and heading != self._heading:
            self.turned.append(self.intensity)
        self._heading = heading
        step = self.steps[min(len(self.turned), len(self.steps) - 1)]
        size = step * self.up_ratio if heading > 0 else -step
        # Rounded, so that ways of different steps to one level meet there.
        self.intensity = round(min(max(self.intensity + size, self.low), self.high), 12)

    def threshold(self) -> float:
        """Return the mean of the reversals, without the first few; NaN before there are two.

        The number that is kept is even, so that peaks and valleys count equally.
        """
        kept = self.turned[DISCARDED:] if len(self.turned) > DISCARDED + 1 else self.turned
        kept = kept[len(kept) % 2 :]
        return sum(kept) / len(kept) if kept else float("nan")
