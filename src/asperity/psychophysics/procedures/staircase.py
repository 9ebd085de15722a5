"""Adaptive staircases: transformed and weighted up-down methods.

After `down` right answers in a row the level goes down by a step, after a wrong one it goes up by
`up_ratio` steps. The level then converges to where a step down, weighed by its size, is as likely
as one up:

    p^down step = (1 - p^down) up_ratio step,  so  p = (up_ratio / (1 + up_ratio))^(1 / down)

`up_ratio` of 1 is the transformed rule (Levitt 1971, J. Acoust. Soc. Am. 49, 467-477: two down, one
up finds 70.7 % right); `down` of 1 is the weighted one (Kaernbach 1991, Percept. Psychophys. 49,
227-229: a ratio of 3 finds 75 %). The equation holds for small steps; with large ones the level
converges elsewhere (Garcia-Perez 1998, Vision Res. 38, 1861-1881), which is why the analysis fits a
psychometric function to all answers and does not rest on the reversals alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from asperity.errors import AsperityError, require_between, require_not_negative, require_positive


@dataclass(frozen=True)
class StaircaseSettings:
    """Rules of a staircase. Levels and steps are on the scale of the experiment's intensities.

    Parameters
    ----------
    start : tuple of float
        Start level of each interleaved track; one value for one track.
    steps : tuple of float
        Size of a step down; the next one is taken after each reversal, and the last one is kept.
        Factors above 1 on a logarithmic scale of levels, differences on a linear one.
    down : int
        Consecutive right answers before a step down, 1 to 8.
    up_ratio : float
        Size of a step up relative to a step down.
    reversals : int
        Number of reversals after which a track ends; 0: no matter how many.
    trials : int
        Number of trials after which a track ends, whichever comes first. The default, in one track
        or in all together, is what intervals of the threshold need to be as wide as they say.
    """

    start: tuple[float, ...]
    steps: tuple[float, ...]
    down: int = 1
    up_ratio: float = 3.0
    reversals: int = 0
    trials: int = 160

    def __post_init__(self) -> None:
        if not self.start or not self.steps:
            raise AsperityError("start and steps must each hold at least one value")
        for value in self.steps:
            require_positive("steps", value)
        require_between("down", self.down, 1, 8)
        require_positive("up_ratio", self.up_ratio)
        require_between("reversals", self.reversals, 0, 1000)
        require_between("trials", self.trials, 1, 10000)

    @property
    def most(self) -> int:
        """Largest number of trials of all tracks."""
        return self.trials * len(self.start)

    @property
    def target(self) -> float:
        """Proportion of right answers at which the level converges."""
        return float((self.up_ratio / (1.0 + self.up_ratio)) ** (1.0 / self.down))


@dataclass
class Staircase:
    """One staircase track and its state.

    Parameters
    ----------
    start : float
        First intensity.
    steps : tuple of float
        Sizes of the step down, as intensities.
    down, up_ratio, reversals, trials
        See `StaircaseSettings`.
    low, high : float
        Limits of the intensity.
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
    """Number of answers so far."""
    reversal_intensities: list[float] = field(init=False, default_factory=list)
    """Intensities of the reversals."""
    _row: int = field(init=False, default=0)
    _heading: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        for step in self.steps:
            require_not_negative("step", step)
        self.intensity = min(max(self.start, self.low), self.high)

    @property
    def is_over(self) -> bool:
        """Whether the track has ended."""
        return (0 < self.reversals <= len(self.reversal_intensities)) or self.done >= self.trials

    def answer(self, right: bool) -> None:
        """Update the track with the answer at `intensity`."""
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
            self.reversal_intensities.append(self.intensity)
        self._heading = heading
        step = self.steps[min(len(self.reversal_intensities), len(self.steps) - 1)]
        size = step * self.up_ratio if heading > 0 else -step
        # Rounded, so that different step sequences to one level give the same number.
        self.intensity = round(min(max(self.intensity + size, self.low), self.high), 12)

    def threshold(self) -> float:
        """Return the mean intensity of the reversals, NaN before there are two of them.

        The first four are left out where enough others remain, as the track descends from its start
        (a project choice). The number of reversals averaged is even, so that peaks and valleys
        count equally.
        """
        kept = self.reversal_intensities
        if len(kept) > 5:
            kept = kept[4:]
        kept = kept[len(kept) % 2 :]
        return sum(kept) / len(kept) if kept else float("nan")
