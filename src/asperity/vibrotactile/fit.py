"""A texture model from explorations, and how well it does on others.

The way is that of Culbertson et al. (2013, 2014): vibration cut into stretches that stay the same,
an AR model of each, line spectral frequencies over force and speed, silence at rest and in the
air. asperity's own, and not theirs: the search for the cuts (`segments`), the order by BIC over
all stretches together, Burg's estimator, the joining of stretches at nearly the same force and
speed, and the narrowest bandwidth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from asperity._core.arrays import Array, Indices
from asperity.errors import AsperityError, require_between, require_choice
from asperity.vibrotactile.ar import CRITERIA, Autoregression, burg, criterion, damped
from asperity.vibrotactile.distances import Match, match
from asperity.vibrotactile.lsf import frequencies_of
from asperity.vibrotactile.model import TextureModel
from asperity.vibrotactile.segments import cuts
from asperity.vibrotactile.signals import Exploration, true_stretches
from asperity.vibrotactile.synthesis import Synthesiser

_BLOCK = 0.02
"""Cuts fall on multiples of this [s]."""
_SEGMENT_ORDER = 8
"""Of the AR processes that tell stretches apart."""
_SLOWEST = 1e-3
"""Below this speed the tool rests [m/s]."""
_SPREAD = 0.3
"""How far speed and force may vary within a stretch, as deviation over mean."""
_NEAR = 0.1
"""Stretches within this part of the largest force and speed are one model."""
_RIM = 5
"""Models along each side of the plane where nothing was recorded."""
_PER_COEFFICIENT = 8
"""Samples that a model needs for each of its coefficients."""
_LONG = 4.0
"""How long a vibration is synthesised to be compared [s]."""
_WARM = 0.5


@dataclass(frozen=True)
class FitSettings:
    """How a model is fitted.

    Parameters
    ----------
    order : int, optional
        AR coefficients, 1 to 60. Default: as the criterion has it.
    criterion : {"bic", "aic"}
    highest : int
        The highest order that the criterion may choose, 1 to 60.
    bandwidth : float
        No resonance is narrower [Hz], 0.1 to 100.
    shortest, longest : float
        Of a stretch [s].
    """

    order: int | None = None
    criterion: str = "bic"
    highest: int = 20
    bandwidth: float = 4.0
    shortest: float = 0.15
    longest: float = 1.0

    def __post_init__(self) -> None:
        if self.order is not None:
            require_between("order", self.order, 1, 60)
        require_choice("criterion", self.criterion, CRITERIA)
        require_between("highest order", self.highest, 1, 60)
        require_between("bandwidth", self.bandwidth, 0.1, 100.0, "Hz")
        require_between("shortest stretch", self.shortest, 0.02, 10.0, "s")
        require_between("longest stretch", self.longest, 2.0 * self.shortest, 100.0, "s")


class Stretch(NamedTuple):
    """A part of an exploration that stays the same."""

    exploration: Exploration
    begin: int
    end: int
    speed: float
    """Mean [m/s]."""
    force: float
    """Mean [N]."""
    vibration: Array
    """Without its mean [m/s^2]."""


class Fitted(NamedTuple):
    """A model and what it was made of."""

    model: TextureModel
    stretches: list[Stretch]
    recorded: int
    """How many models come from recordings; the rest stand on the rim."""
    scores: Array
    """(highest + 1,): the criterion over all models, for each order; less is better."""
    dropped: int
    """Stretches left out, because speed or force changed too much, or they were too short."""


class Held(NamedTuple):
    """A held-out stretch, against what the model makes at its forces and speeds."""

    stretch: Stretch
    made: Array
    match: Match
    itself: Match
    """The first half of the recording against its second: an upper limit for any model."""
    noise: Match
    """White noise of the same size: what is to be beaten."""


def stretches_of(exploration: Exploration, settings: FitSettings) -> tuple[list[Stretch], int]:
    """Return the stretches of an exploration, and how many were left out."""
    rate, found, dropped = exploration.rate, [], 0
    moving = exploration.touching & (exploration.speed > _SLOWEST)
    shortest = int(settings.shortest * rate)
    for begin, end in zip(*true_stretches(moving), strict=True):
        if end - begin < shortest:
            continue
        places = cuts(
            exploration.vibration[begin:end], order=_SEGMENT_ORDER, block=round(_BLOCK * rate),
            shortest=shortest, longest=int(settings.longest * rate),
        )  # fmt: skip
        for first, last in pairwise(places):
            a, b = int(begin) + first, int(begin) + last
            speed, force = exploration.speed[a:b], exploration.force[a:b]
            mean_speed, mean_force = float(speed.mean()), float(force.mean())
            if speed.std() > _SPREAD * mean_speed or force.std() > _SPREAD * mean_force:
                dropped += 1
                continue
            part = exploration.vibration[a:b]
            found.append(Stretch(exploration, a, b, mean_speed, mean_force, part - part.mean()))
    return found, dropped


def fit(
    explorations: Sequence[Exploration], settings: FitSettings | None = None, *,
    name: str = "texture",
) -> Fitted:  # fmt: skip
    """Return a texture model of explorations, all at one rate.

    Raises
    ------
    AsperityError
        There is too little to fit, nothing vibrates, or all forces or speeds are the same.
    """
    settings = FitSettings() if settings is None else settings
    rates = sorted({round(one.rate, 6) for one in explorations})
    if len(rates) > 1:
        raise AsperityError(f"runs at different rates cannot be one model: {rates} Hz")
    stretches, dropped = [], 0
    for one in explorations:
        found, left = stretches_of(one, settings)
        stretches += found
        dropped += left
    highest = settings.order or settings.highest
    groups = _groups(stretches)
    members = [
        [s for s, at in zip(stretches, groups, strict=True) if at == group]
        for group in range(groups.max(initial=-1) + 1)
    ]
    least = _PER_COEFFICIENT * highest
    members = [own for own in members if sum(s.vibration.size for s in own) >= least]
    kept = [s for own in members for s in own]
    dropped += len(stretches) - len(kept)
    if not kept:
        raise AsperityError(
            f"no stretch of {settings.shortest:g} s or more in which a tool slides evenly in "
            f"contact ({dropped} left out): record longer, at steadier speeds and forces"
        )
    ladders = [burg([s.vibration for s in own], highest) for own in members]
    scores = np.sum([[criterion(m, settings.criterion) for m in one] for one in ladders], axis=0)
    order = settings.order or max(int(np.argmin(scores)), 1)
    rate = rates[0]
    model = _assembled(
        [damped(one[order], one[0].variance, rate, settings.bandwidth) for one in ladders], members,
        rate=rate, friction=_friction(kept), name=name,
    )  # fmt: skip
    return Fitted(model, kept, len(members), np.asarray(scores), dropped)


def _groups(stretches: list[Stretch]) -> Indices:
    """Return the group (n,) of each stretch: no two of one are far apart in force and speed."""
    if len(stretches) < 2:
        return np.zeros(len(stretches), np.int64)
    places = np.array([(s.speed, s.force) for s in stretches])
    tree = linkage(places / places.max(axis=0), "complete")
    return np.asarray(fcluster(tree, _NEAR, "distance"), dtype=np.int64) - 1


def _friction(stretches: list[Stretch]) -> float:
    """Return the kinetic coefficient that fits drag over normal force best."""
    drag = np.concatenate([s.exploration.drag[s.begin : s.end] for s in stretches])
    force = np.concatenate([s.exploration.force[s.begin : s.end] for s in stretches])
    return max(float(drag @ force / max(float(force @ force), 1e-300)), 0.0)


def _assembled(
    filters: list[Autoregression], members: list[list[Stretch]], *,
    rate: float, friction: float, name: str,
) -> TextureModel:  # fmt: skip
    """Return the model: what was recorded, and a rim round the plane of force and speed.

    At rest and in the air there is silence; towards the largest force and speed the nearest
    recorded model goes on. So every place up to them lies in a triangle, as HaTT has it.
    """
    speeds, forces = np.array(
        [
            np.average(
                [(s.speed, s.force) for s in own], axis=0,
                weights=[s.vibration.size for s in own],
            )
            for own in members
        ]
    ).T  # fmt: skip
    lsf = np.array([frequencies_of(f.coefficients) for f in filters])
    variance = np.array([f.variance for f in filters])
    top = np.array([speeds.max(), forces.max()])
    places = np.column_stack([speeds, forces]) / top
    rim = []
    for k in range(_RIM):
        s = k / (_RIM - 1)
        rim += [(0.0, s), (s, 0.0), (1.0, s), (s, 1.0)]
    for place in dict.fromkeys(rim):
        away = np.linalg.norm(places[: len(filters)] - place, axis=1)
        nearest = int(np.argmin(away))
        silent = 0.0 in place
        close = away[nearest] < 0.5 / (_RIM - 1)
        # Where a model stands close by, the corner alone is needed to close the plane.
        if not silent and close and (place != (1.0, 1.0) or away[nearest] == 0.0):
            continue
        places = np.vstack([places, place])
        lsf = np.vstack([lsf, lsf[nearest]])
        variance = np.append(variance, 0.0 if silent else variance[nearest])
    return TextureModel(
        name=name, rate=rate, speeds=places[:, 0] * top[0], forces=places[:, 1] * top[1], ar=lsf,
        variance=variance, friction=friction,
    )  # fmt: skip


def judge(
    model: TextureModel, explorations: Sequence[Exploration], settings: FitSettings | None = None,
    *, seed: int = 0,
) -> list[Held]:  # fmt: skip
    """Return how well a model does on explorations that it was not made of, stretch by stretch."""
    settings = FitSettings() if settings is None else settings
    rng = np.random.default_rng(seed)
    out = []
    for one in explorations:
        if abs(one.rate / model.rate - 1.0) > 1e-6:
            raise AsperityError(f"{one.name} is at {one.rate:g} Hz, the model at {model.rate:g} Hz")
        for i, stretch in enumerate(stretches_of(one, settings)[0]):
            if not np.any(stretch.vibration):
                continue
            cut = slice(stretch.begin, stretch.end)
            made = long_vibration(model, one.speed[cut], one.force[cut], seed=seed + i)
            if not np.any(made):
                continue
            half = stretch.vibration.size // 2
            level = float(np.std(stretch.vibration))
            out.append(
                Held(
                    stretch, made, match(stretch.vibration, made, one.rate),
                    match(stretch.vibration[:half], stretch.vibration[half:], one.rate),
                    match(stretch.vibration, level * rng.standard_normal(made.size), one.rate),
                )
            )  # fmt: skip
    return out


def long_vibration(
    model: TextureModel, speed: Array, force: Array, *, seed: int = 0, seconds: float = _LONG
) -> Array:
    """Return what a model makes at speeds and forces, over and over for `seconds`, settled."""
    count, warm = int(seconds * model.rate), int(_WARM * model.rate)
    repeats = -(-(count + warm) // speed.size)
    speeds, forces = np.tile(speed, repeats), np.tile(force, repeats)
    made = Synthesiser(model, seed=seed).block(speeds[: count + warm], forces[: count + warm])
    return made[warm:]
