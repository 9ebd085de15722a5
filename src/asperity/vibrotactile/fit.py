"""A texture model from explorations, and how well it does on others.

The way is that of Culbertson et al. (2013, 2014): vibration cut into stretches that stay the same,
an AR model of each, line spectral frequencies over force and speed, silence at rest and in the
air. asperity's own, and not theirs: the lines locked to position (`harmonic`, `periods`), the noise
beside them before its high-pass filter (`high_pass`), the search for the cuts (`segments`), the
order by BIC over all stretches together, Burg's estimator, the joining of stretches at nearly the
same force and speed, the narrowest bandwidth, and that a filter's excitation gives the RMS that was
measured.
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
from asperity.vibrotactile.high_pass import fit_before, passed_gain
from asperity.vibrotactile.lsf import frequencies_of
from asperity.vibrotactile.model import TextureModel
from asperity.vibrotactile.periods import NO_PERIODS, Periodicity, find_periods, lines_of
from asperity.vibrotactile.signals import HIGH_PASS, Exploration
from asperity.vibrotactile.stretches import Stretch, joined, stretches_of
from asperity.vibrotactile.synthesis import Synthesiser
from asperity.vibrotactile.triangles import rim_places, triangulated, without_slivers

KINDS = ("harmonic", "noise")
"""What a model is made of: lines locked to position and noise, or noise alone as in HaTT."""
_NEAR = 0.1
"""Stretches within this part of the largest force and speed are one model."""
_STRETCH = 8.0
"""By which speeds count more than forces for neighbours in a harmonic model: a spectrum moves with
the speed, and of the force it is mainly the size that changes."""
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
    rate, chosen = rates[0], str(settings.criterion)
    corner = HIGH_PASS if settings.kind == "harmonic" else 0.0
    ladders = [
        fit_before(node.noise, highest, corner, rate) if corner else burg(node.noise, highest)
        for node in nodes
    ]
    scores = np.sum([[criterion(m, chosen) for m in one] for one in ladders], axis=0)
    order = settings.order or max(int(np.argmin(scores)), 1)
    filters = [
        _levelled(damped(one[order], one[0].variance, rate, settings.bandwidth), node, corner, rate)
        for one, node in zip(ladders, nodes, strict=True)
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


def _levelled(model: Autoregression, node: _Node, corner: float, rate: float) -> Autoregression:
    """Return the model with the excitation that gives the noise's power behind its high-pass.

    That of the fit is the variance of prediction errors, and for lines and bumps another.
    """
    power = sum(float(s @ s) for s in node.noise) / sum(s.size for s in node.noise)
    return model._replace(variance=power / passed_gain(model.coefficients, corner, rate))


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
    """Return the model: what was recorded and, where it is needed, a rim round the plane.

    Of noise, there is silence at rest and in the air, and towards the largest force and speed the
    nearest recorded model goes on: so every place up to them lies in a triangle, as HaTT has it.
    A harmonic model goes on and fades by itself, and models on a rim would be mixed into places
    between recorded ones. Only if all were recorded on one line does it have such a rim, too.
    """
    speeds, forces = np.array([(node.speed, node.force) for node in nodes]).T
    lsf = np.array([frequencies_of(f.coefficients) for f in filters])
    variance = np.array([f.variance for f in filters])
    lines = _spatial_lines(nodes, periodicity)
    triangles = None
    if kind == "harmonic":
        with suppress(AsperityError):  # all on one line
            triangles = without_slivers(triangulated(speeds, forces, stretch=_STRETCH))
    if triangles is None:
        top = np.array([speeds.max(), forces.max()])
        recorded = np.column_stack([speeds, forces]) / top
        rim = np.array(rim_places(recorded))
        away = np.linalg.norm(recorded[:, None] - rim, axis=2)
        nearest = np.append(np.arange(len(recorded)), away.argmin(axis=0))
        silent = np.append(np.zeros(len(recorded), bool), rim.min(axis=1) == 0.0)
        speeds, forces = (np.vstack([recorded, rim]) * top).T
        lsf, variance, lines = lsf[nearest], variance[nearest], lines[nearest]
        variance[silent & (kind == "noise")] = 0.0
    common = {
        "name": name, "rate": rate, "speeds": speeds, "forces": forces, "ar": lsf,
        "variance": variance, "friction": friction, "triangles": triangles,
    }  # fmt: skip
    if kind == "noise":
        return TextureModel(**common)
    measured = [(node.speed, node.force) for node in nodes]
    slowest, lightest = np.min(measured, axis=0)
    return HarmonicModel(
        **common, periods=periodicity.periods, harmonics=periodicity.harmonics, lines=lines,
        high_pass=HIGH_PASS, noise_high_pass=HIGH_PASS, slowest=float(slowest),
        lightest=float(lightest),
    )  # fmt: skip


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
