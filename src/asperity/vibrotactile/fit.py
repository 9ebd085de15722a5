"""A texture model from explorations, and how well it does on others.

The way is that of Culbertson et al. (2013, 2014): vibration cut into stretches that stay the same,
an AR model of each, line spectral frequencies over force and speed, silence at rest and in the
air. asperity's own, and not theirs: the lines locked to position (`harmonic`, `periods`), the
search for the cuts (`segments`), the order by BIC over all stretches together, Burg's estimator,
the joining of stretches at nearly the same force and speed, the narrowest bandwidth, and that a
filter's excitation gives the RMS that was measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from asperity._core.arrays import Array, Indices, Mask
from asperity.errors import AsperityError, require_between, require_choice
from asperity.vibrotactile.ar import CRITERIA, Autoregression, burg, criterion, damped
from asperity.vibrotactile.distances import Match, match
from asperity.vibrotactile.harmonic import Amplitudes, HarmonicModel, high_pass_gain
from asperity.vibrotactile.lsf import coefficients_of, frequencies_of, power_gain
from asperity.vibrotactile.model import TextureModel
from asperity.vibrotactile.periods import NO_PERIODS, Periodicity, find_periods, lines_of
from asperity.vibrotactile.signals import HIGH_PASS, Exploration
from asperity.vibrotactile.stretches import Stretch, joined, stretches_of
from asperity.vibrotactile.synthesis import Synthesiser
from asperity.vibrotactile.triangles import Triangulation, triangulated, weigh

KINDS = ("harmonic", "noise")
"""What a model is made of: lines locked to position and noise, or noise alone as in HaTT."""
_NEAR = 0.1
"""Stretches within this part of the largest force and speed are one model."""
_RIM = 5
"""Models along each side of the plane where nothing was recorded."""
_PER_COEFFICIENT = 8
"""Samples that a model needs for each of its coefficients."""
_FAINT = 0.1
"""Where the high-pass leaves less of a line than this, it is not measured but inferred."""
_LONG = 4.0
"""How long a vibration is synthesised to be compared [s]."""
_WARM = 0.5


@dataclass(frozen=True)
class FitSettings:
    """How a model is fitted.

    Parameters
    ----------
    kind : {"harmonic", "noise"}
        *harmonic*: what repeats over distance as lines, the remainder as noise; of a texture that
        does not repeat, noise alone. *noise*: all as noise, as Culbertson et al. and HaTT have it.
    order : int, optional
        AR coefficients, 1 to 60. Default: as the criterion has it.
    criterion : {"bic", "aic"}, optional
        For the order. Default: aic for a harmonic model, bic for noise alone.
    highest : int
        The highest order that the criterion may choose, 1 to 60.
    bandwidth : float
        No resonance is narrower [Hz], 0.1 to 100.
    shortest, longest : float
        Of a stretch [s].
    lines : int
        Most lines of a harmonic model, 1 to 64.
    """

    kind: str = "harmonic"
    order: int | None = None
    criterion: str | None = None
    highest: int = 20
    bandwidth: float = 4.0
    shortest: float = 0.15
    longest: float = 1.0
    lines: int = 16

    def __post_init__(self) -> None:
        require_choice("kind of vibration model", self.kind, KINDS)
        if self.order is not None:
            require_between("order", self.order, 1, 60)
        if self.criterion is None:
            # On random surfaces BIC takes order 2, and the power about the peak comes out too low.
            object.__setattr__(self, "criterion", "aic" if self.kind == "harmonic" else "bic")
        require_choice("criterion", str(self.criterion), CRITERIA)
        require_between("highest order", self.highest, 1, 60)
        require_between("bandwidth", self.bandwidth, 0.1, 100.0, "Hz")
        require_between("shortest stretch", self.shortest, 0.02, 10.0, "s")
        require_between("longest stretch", self.longest, 2.0 * self.shortest, 100.0, "s")
        require_between("lines", self.lines, 1, 64)


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
    lost: tuple[str, ...]
    """Explorations that left no model: name and reason, a line each."""


class Held(NamedTuple):
    """A held-out stretch, against what the model makes at its forces and speeds."""

    stretch: Stretch
    made: Array
    match: Match
    itself: Match
    """The first half of the recording against its second: an upper limit for any model."""
    noise: Match
    """White noise of the same size: what is to be beaten."""


def fit(
    explorations: Sequence[Exploration], settings: FitSettings | None = None, *,
    name: str = "texture",
) -> Fitted:  # fmt: skip
    """Return a texture model of explorations, all at one rate.

    Returns
    -------
    Fitted
        Its `model` is a `HarmonicModel`, or a plain `TextureModel` for the kind "noise"; `lost`
        names each exploration that left no model.

    Raises
    ------
    AsperityError
        There is too little to fit, nothing vibrates, or all forces or speeds are the same.
    """
    settings = FitSettings() if settings is None else settings
    rates = sorted({round(one.rate, 6) for one in explorations})
    if len(rates) > 1:
        raise AsperityError(f"runs at different rates cannot be one model: {rates} Hz")
    stretches, lost, dropped = [], [], 0
    for one in explorations:
        found = stretches_of(one, settings.shortest, settings.longest)
        stretches += found.stretches
        dropped += found.dropped
        if found.lost:
            lost.append(f"{one.name}: {found.lost}")
    highest = settings.order or settings.highest
    members = _members(stretches, _PER_COEFFICIENT * highest)
    kept = [s for own in members for s in own]
    dropped += len(stretches) - len(kept)
    for one in explorations:
        mine = [s for s in stretches if s.exploration is one]
        if mine and not any(s.exploration is one for s in kept):
            lost.append(
                f"{one.name}: {sum(s.vibration.size for s in mine)} samples; valid: "
                f"{_PER_COEFFICIENT * highest} or more for an order of {highest}"
            )
    if not kept:
        reasons = "; ".join(lost) if lost else "there are no recordings"
        raise AsperityError(
            f"no stretch of {settings.shortest:g} s or more in which a tool slides evenly in "
            f"contact ({reasons}): record longer, at steadier speeds and forces"
        )
    periodicity = NO_PERIODS
    if settings.kind == "harmonic":
        periodicity = find_periods(joined(kept), settings.lines)
    nodes = [_node(own, periodicity, settings) for own in members]
    ladders = [burg(node.noise, highest) for node in nodes]
    chosen = str(settings.criterion)
    scores = np.sum([[criterion(m, chosen) for m in one] for one in ladders], axis=0)
    order = settings.order or max(int(np.argmin(scores)), 1)
    rate = rates[0]
    filters = [
        _levelled(damped(one[order], one[0].variance, rate, settings.bandwidth), one[0].variance)
        for one in ladders
    ]
    model = _assembled(
        nodes, filters, periodicity, settings.kind, rate=rate, friction=_friction(kept), name=name
    )
    return Fitted(model, kept, len(members), np.asarray(scores), dropped, tuple(lost))


class _Node(NamedTuple):
    """What was measured at one place of force and speed."""

    speed: float
    force: float
    noise: list[Array]
    """The vibration without its lines [m/s^2]."""
    lines: Amplitudes
    """(h,) as measured behind the high-pass [m/s^2]."""
    seen: Mask
    """(h,) whether they could be measured."""


def _node(own: Sequence[Stretch], periodicity: Periodicity, settings: FitSettings) -> _Node:
    sizes = [s.vibration.size for s in own]
    speed, force = np.average([(s.speed, s.force) for s in own], axis=0, weights=sizes)
    if settings.kind == "noise":
        lines, seen, noise = np.zeros(0, complex), np.zeros(0, bool), [s.vibration for s in own]
    else:
        lines, seen, noise = lines_of(joined(own), periodicity)
    return _Node(float(speed), float(force), noise, lines, seen)


def _levelled(model: Autoregression, power: float) -> Autoregression:
    """Return the model with the excitation that gives `power`.

    Burg's variance is that of the prediction errors. For lines and bumps it is not what the filter
    needs to give back the power of the signal.
    """
    return model._replace(variance=power / power_gain(model.coefficients))


def _members(stretches: list[Stretch], least: int) -> list[list[Stretch]]:
    """Return the stretches of each model, of `least` samples or more."""
    groups = _groups(stretches)
    members = [
        [s for s, at in zip(stretches, groups, strict=True) if at == group]
        for group in range(groups.max(initial=-1) + 1)
    ]
    return [own for own in members if sum(s.vibration.size for s in own) >= least]


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
    nodes: Sequence[_Node], filters: Sequence[Autoregression], periodicity: Periodicity, kind: str,
    *, rate: float, friction: float, name: str,
) -> TextureModel:  # fmt: skip
    """Return the model: what was recorded, and a rim round the plane of force and speed.

    At rest and in the air there is silence; towards the largest force and speed the nearest
    recorded model goes on. So every place up to them lies in a triangle, as HaTT has it.
    A harmonic model's rim goes on from the nearest place between recorded models, and the model
    fades by itself: silent models at rest would be mixed into places between recorded ones.
    """
    speeds, forces = np.array([(node.speed, node.force) for node in nodes]).T
    lsf = np.array([frequencies_of(f.coefficients) for f in filters])
    variance = np.array([f.variance for f in filters])
    lines = _spatial_lines(nodes, periodicity)
    mixing = _Mixing(speeds, forces) if kind == "harmonic" else None
    top = np.array([speeds.max(), forces.max()])
    places = np.column_stack([speeds, forces]) / top
    recorded = len(filters)
    for place in _rim(places):
        nearest = int(np.argmin(np.linalg.norm(places[:recorded] - place, axis=1)))
        shares = np.eye(recorded)[nearest] if mixing is None else mixing.at(*(place * top))
        fresh = shares @ lsf[:recorded]
        level, size = variance[nearest], np.zeros(lines.shape[1])
        if mixing is not None:
            gains = [power_gain(f.coefficients) for f in filters]
            rms = float(shares @ np.sqrt(variance[:recorded] * gains))
            level = rms**2 / power_gain(coefficients_of(fresh))
            mean = shares @ lines[:recorded]
            size = shares @ np.abs(lines[:recorded]) * np.exp(1j * np.angle(mean))
        places = np.vstack([places, place])
        lsf = np.vstack([lsf, fresh])
        variance = np.append(variance, level * (mixing is not None or place.min() > 0.0))
        lines = np.vstack([lines, size])
    common = {
        "name": name, "rate": rate, "speeds": places[:, 0] * top[0],
        "forces": places[:, 1] * top[1], "ar": lsf, "variance": variance, "friction": friction,
    }  # fmt: skip
    if kind == "noise":
        return TextureModel(**common)
    return HarmonicModel(
        **common, periods=periodicity.periods, harmonics=periodicity.harmonics, lines=lines,
        high_pass=HIGH_PASS, slowest=float(speeds.min()), lightest=float(forces.min()),
    )  # fmt: skip


def _rim(places: Array) -> list[Array]:
    """Return places on the rim of the unit square where no model of `places` (n, 2) stands."""
    rim, out = [], []
    for k in range(_RIM):
        s = k / (_RIM - 1)
        rim += [(0.0, s), (s, 0.0), (1.0, s), (s, 1.0)]
    for place in dict.fromkeys(rim):
        nearest = float(np.linalg.norm(places - place, axis=1).min())
        close = nearest < 0.5 / (_RIM - 1)
        # Where a model stands close by, the corner alone is needed to close the plane.
        if 0.0 in place or not close or (place == (1.0, 1.0) and nearest > 0.0):
            out.append(np.array(place))
    return out


class _Mixing:
    """Shares of recorded models at any place; beyond them, at the nearest place between them."""

    def __init__(self, speeds: Array, forces: Array) -> None:
        self._places = np.column_stack([speeds / speeds.max(), forces / forces.max()])
        self._top = np.array([speeds.max(), forces.max()])
        self._mesh: Triangulation | None = None
        with suppress(AsperityError):  # all on one line: the nearest model alone
            self._mesh = triangulated(speeds, forces)

    def at(self, speed: float, force: float) -> Array:
        """Return the shares (n,) at a speed [m/s] and a force [N]."""
        out = np.zeros(len(self._places))
        if self._mesh is None:
            away = np.linalg.norm(self._places - np.array([speed, force]) / self._top, axis=1)
            out[int(np.argmin(away))] = 1.0
            return out
        corners, shares = np.empty(3, np.int64), np.empty(3)
        weigh(self._mesh, speed, force, -1, corners, shares)
        np.add.at(out, corners, shares)
        return out


def _spatial_lines(nodes: Sequence[_Node], periodicity: Periodicity) -> Amplitudes:
    """Return the amplitudes (n, h) of lines without the high-pass.

    Where a line is not seen (too slow for the high-pass, too fast for the rate, too few periods)
    it is that of the model nearest in the logarithm of force, then of speed, times the forces'
    ratio.
    """
    lines = np.array([node.lines for node in nodes])
    if not lines.shape[1]:
        return lines
    speeds, forces = np.array([(node.speed, node.force) for node in nodes]).T
    gain = high_pass_gain(np.outer(speeds, periodicity.wavenumbers), HIGH_PASS)
    seen = np.array([node.seen for node in nodes]) & (gain >= _FAINT)
    spatial = lines / np.maximum(gain, _FAINT)
    for i, j in zip(*np.nonzero(~seen), strict=True):
        others = np.flatnonzero(seen[:, j])
        if not others.size:
            continue
        away = np.abs(np.log(forces[others] / forces[i]))
        away += 0.3 * np.abs(np.log(speeds[others] / speeds[i]))
        best = others[int(np.argmin(away))]
        spatial[i, j] = spatial[best, j] * forces[i] / forces[best]
    return np.asarray(spatial)


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
        for i, stretch in enumerate(
            stretches_of(one, settings.shortest, settings.longest).stretches
        ):
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
