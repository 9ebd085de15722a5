r"""The search for a free height map that repeats, with a spectrum as prior, by its exact gradient.

A map is filtered noise,

    h = F^-1 [ A(q) e^{g(q)} F z ] ,

A the prior (self-affine, without waves that the process cannot make), z white noise, and g a gain
in bands of the wavenumber, equally spaced in log. First g alone is searched: such a map is equally
rough everywhere. Only if that does not meet the target, the noise z itself is, and what the strokes
touch is then shaped for them; the report compares strokes that were not searched over.

The loss is the squared logarithm of value over wanted value, the excess over the limits of the
process, and the size of the changes; L-BFGS takes its gradient from `forward`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from asperity._core.arrays import Array
from asperity.designing.candidate import (
    DesignedSurface,
    DesignSettings,
    at_limits,
    bench_of,
    designed_tile,
    is_reached,
    reached_or_refused,
)
from asperity.designing.forward import Demand
from asperity.designing.pattern_search import Tell
from asperity.designing.process import wavenumbers
from asperity.errors import AsperityError, require_between, require_positive

_GAIN_BANDS = 16
_GAINS, _NOISE = slice(_GAIN_BANDS), slice(_GAIN_BANDS, None)
"""Where they are among the unknowns, and where the noise is."""
_LARGEST_GAIN = 4.0
"""Largest |g|: a factor of 55 on a band's heights."""
_PENALTY = 300.0
_KEPT = (1e-4, 1e-2)
"""Weights of the squares of gains and of noise: of many solutions the plainest is taken."""
_ITERATIONS = 80
_ROUNDS = 3


@dataclass(frozen=True)
class FreeMap:
    """A free height map.

    Parameters
    ----------
    samples : int
        Along each side, 32 to 1024.
    pixel_size : float
        [m]
    hurst, rolloff, rms_slope
        Of the prior, as for `random_surfaces.self_affine`; the rms slope is where the search
        begins.
    """

    samples: int = 256
    pixel_size: float = 5e-5
    hurst: float = 0.8
    rolloff: float = 3e-3
    rms_slope: float = 0.1

    def __post_init__(self) -> None:
        require_between("samples", self.samples, 32, 1024)
        require_positive("pixel_size", self.pixel_size, "[m]")
        require_between("hurst", self.hurst, 0.0, 1.0)
        require_positive("rolloff", self.rolloff, "[m]")
        require_positive("rms_slope", self.rms_slope)


class FreeProblem:
    """Loss and gradient of a free map; unknowns are gains (bands,), then noise (n, n)."""

    def __init__(
        self, unknown: FreeMap, demands: tuple[Demand, ...], settings: DesignSettings, seed: int
    ) -> None:
        if any(demand.spacing is not None for demand in demands):
            raise AsperityError("a free map has no pitch: leave spacing out of its targets")
        self.unknown, self.demands, self.settings = unknown, demands, settings
        self.wanted = np.log([demand.value for demand in demands])
        self.with_noise = False
        n, pixel = unknown.samples, unknown.pixel_size
        self._bench = bench_of(demands, settings)
        self._noise = np.random.default_rng(seed).standard_normal((n, n))
        q = wavenumbers((n, n), (pixel, pixel))
        least, most = 1.0 / (n * pixel), 1.0 / max(settings.process.shortest, 2.0 * pixel)
        if most < 2.0 * least:
            raise AsperityError(
                f"a map of {n * pixel * 1e3:.3g} mm is too small for features of "
                f"{settings.process.feature * 1e3:.3g} mm; give more samples"
            )
        prior = np.maximum(q, 1.0 / unknown.rolloff) ** -(unknown.hurst + 1.0)
        prior = prior * settings.process.passed(q)
        prior[0, 0] = 0.0
        place = np.log(np.maximum(q, least) / least) / math.log(most / least) * (_GAIN_BANDS - 1)
        self._bands = np.stack(
            [np.maximum(0.0, 1.0 - np.abs(place - i)) for i in range(_GAIN_BANDS)], axis=0
        )
        self._bands[-1][place > _GAIN_BANDS - 1] = 1.0
        self._weights = np.full(q.shape, 2.0)
        self._weights[:, 0] = 1.0
        if n % 2 == 0:
            self._weights[:, -1] = 1.0
        self._prior = prior
        slopes = np.fft.irfft2(prior * 2.0 * np.pi * q * np.fft.rfft2(self._noise), s=(n, n))
        self._prior *= unknown.rms_slope / math.sqrt(float(np.mean(slopes**2)))
        self._blur = settings.process.blurred(q)

    @property
    def unknowns(self) -> Array:
        """Where a search begins."""
        noise = self._noise.ravel() if self.with_noise else np.zeros(0)
        return np.concatenate([np.zeros(_GAIN_BANDS), noise])

    def _gain(self, x: Array) -> Array:
        return np.asarray(self._prior * np.exp(np.tensordot(x[_GAINS], self._bands, 1)))

    def _waves(self, x: Array) -> Array:
        n = self.unknown.samples
        noise = x[_NOISE].reshape(n, n) if x.size > _GAIN_BANDS else self._noise
        return np.asarray(self._gain(x) * np.fft.rfft2(noise))

    def heights(self, x: Array) -> Array:
        """Return the map to make (n, n) [m]."""
        n = self.unknown.samples
        return np.asarray(np.fft.irfft2(self._waves(x), s=(n, n)))

    def values(self, x: Array, *, steps: bool) -> Array:
        """Return the numbers (m,) of the demands."""
        pixel = self.unknown.pixel_size
        made = self.settings.process.made(self.heights(x), (pixel, pixel), steps=steps)
        return self._bench.values(made, pixel)

    def loss(self, x: Array) -> tuple[float, Array]:
        """Return the loss and its gradient by the unknowns."""
        n, pixel = self.unknown.samples, self.unknown.pixel_size
        waves = self._waves(x)
        heights = np.fft.irfft2(waves, s=(n, n))
        made = np.fft.irfft2(waves * self._blur, s=(n, n))
        miss = np.zeros(len(self.demands))

        def weights(values: Array) -> Array:
            miss[:] = np.log(np.maximum(values, 1e-12)) - self.wanted
            return miss / np.maximum(values, 1e-12)

        _, by_made = self._bench.values_and_gradient(made, pixel, weights)
        by_heights = np.fft.irfft2(np.fft.rfft2(by_made) * self._blur, s=(n, n))
        over, by_over = self._excess(heights)
        by_heights += by_over
        by_waves = np.fft.rfft2(by_heights)
        # Parseval: the real transform holds each wave once, but for its first and last columns.
        shares = self._weights * np.real(np.conj(by_waves) * waves) / n**2
        by_gain = np.tensordot(self._bands, shares, 2)
        gains = x[_GAINS]
        mean = float(np.mean(gains))
        value = 0.5 * float(np.sum(miss**2)) + over
        # The level is free; only what changes the spectrum's form costs.
        value += _KEPT[0] * float(np.sum((gains - mean) ** 2))
        by_gain += 2.0 * _KEPT[0] * (gains - mean)
        if x.size == _GAIN_BANDS:
            return value, by_gain
        change = (x[_NOISE] - self._noise.ravel()) / n
        value += _KEPT[1] * float(np.sum(change**2))
        by_noise = np.fft.irfft2(by_waves * self._gain(x), s=(n, n)).ravel()
        by_noise += 2.0 * _KEPT[1] * change / n
        return value, np.concatenate([by_gain, by_noise])

    def _excess(self, heights: Array) -> tuple[float, Array]:
        """Return the penalty for heights and slopes beyond the process, and its gradient."""
        process, pixel = self.settings.process, self.unknown.pixel_size
        half = 0.495 * process.relief
        beyond = np.maximum(np.abs(heights) / half - 1.0, 0.0)
        value = _PENALTY * float(np.mean(beyond**2))
        gradient = _PENALTY * 2.0 * beyond * np.sign(heights) / (half * heights.size)
        steepest = 0.99 * process.slope
        for shift_u, shift_v in ((-1, -1), (1, 1)):
            along = shift_u * (heights - np.roll(heights, shift_u, 1)) / -pixel
            across = shift_v * (heights - np.roll(heights, shift_v, 0)) / -pixel
            slope = np.hypot(along, across)
            beyond = np.maximum(slope / steepest - 1.0, 0.0)
            value += _PENALTY * float(np.mean(beyond**2))
            share = _PENALTY * 2.0 * beyond / (steepest * heights.size * np.maximum(slope, 1e-30))
            for part, shift, axis in ((along, shift_u, 1), (across, shift_v, 0)):
                change = share * part * shift / -pixel
                gradient = gradient + change - np.roll(change, -shift, axis)
        return value, gradient

    def levelled(self, x: Array) -> Array:
        """Return the unknowns with all heights scaled to what is wanted on average."""
        x = np.array(x)
        for i in range(8):
            try:
                values = self.values(x, steps=False)
            except AsperityError:  # too rough for the hand to move
                if i == 7:
                    raise
                x[_GAINS] -= math.log(2.0)
                continue
            miss = self.wanted - np.log(np.maximum(values, 1e-12))
            if np.abs(np.mean(miss)) < 1e-3:
                break
            degree = self.demands[0].measure.degree
            x[_GAINS] += float(np.mean(miss)) / degree
        x[_GAINS] = np.clip(x[_GAINS], -_LARGEST_GAIN, _LARGEST_GAIN)
        return x

    def surface(self, x: Array) -> DesignedSurface:
        """Return the surface at unknowns, with layers."""
        process = self.settings.process
        found = self.values(x, steps=True)
        tile = designed_tile(self.heights(x), self.unknown.pixel_size, process)
        rms = float(tile.to_make.rms)
        return DesignedSurface(
            "free", {"rms_height": rms}, self.demands, found, {None: tile},
            at_limits(tile, process),
        )  # fmt: skip


class Retreating:
    """A loss that points back to its last good place where no hand would move.

    A step of the line search may lead to a map in whose notches the hand stays. Such a map has no
    metrics, but those on the way to it may be good.
    """

    def __init__(self, loss: Callable[[Array], tuple[float, Array]]) -> None:
        self._loss, self._good = loss, (math.nan, np.zeros(0))

    def __call__(self, x: Array) -> tuple[float, Array]:
        """Return the loss and its gradient at x."""
        try:
            value, gradient = self._loss(x)
        except AsperityError:
            value, last = self._good
            if math.isnan(value):
                raise
            away = x - last
            far = float(away @ away)
            return 2.0 * value + 1.0, away * (2.0 * (value + 1.0) / max(far, 1e-300))
        self._good = value, np.array(x)
        return value, gradient


def _minimise(problem: FreeProblem, x: Array, tell: Tell | None) -> Array:
    from scipy.optimize import minimize

    bounds = [(-_LARGEST_GAIN, _LARGEST_GAIN)] * _GAIN_BANDS + [(None, None)] * (
        x.size - _GAIN_BANDS
    )
    enough = 0.5 * (0.2 * problem.settings.tolerance) ** 2

    def after(intermediate_result: object) -> None:
        value = intermediate_result.fun  # type: ignore[attr-defined]
        if tell is not None:
            tell("free", math.sqrt(2.0 * value))
        if value < enough:
            raise StopIteration

    found = minimize(
        Retreating(problem.loss), x, jac=True, method="L-BFGS-B", bounds=bounds, callback=after,
        options={"maxiter": _ITERATIONS, "maxcor": 12},
    )  # fmt: skip
    return np.asarray(found.x)


def search_free_map(
    unknown: FreeMap,
    demands: tuple[Demand, ...],
    settings: DesignSettings,
    *,
    accept_nearest: bool = False,
    tell: Tell | None = None,
) -> list[DesignedSurface]:
    """Return free maps that have what is demanded, the nearest first; one for each seed.

    Parameters and errors are those of `pattern_search.search_pattern`.
    """
    if not demands:
        raise AsperityError("a design needs at least one target value")
    surfaces = [
        _one_map(unknown, demands, settings, settings.seed + i, tell)
        for i in range(settings.candidates)
    ]
    return reached_or_refused(surfaces, settings, accept_nearest)


def _one_map(
    unknown: FreeMap, demands: tuple[Demand, ...], settings: DesignSettings, seed: int,
    tell: Tell | None,
) -> DesignedSurface:  # fmt: skip
    problem = FreeProblem(unknown, demands, settings, seed)
    original = np.array(problem.wanted)
    x = problem.levelled(problem.unknowns)
    best = None
    for _ in range(_ROUNDS):
        x = _minimise(problem, x, tell)
        surface = problem.surface(x)
        good = is_reached(surface, settings)
        if best is None or surface.worst < best.worst or good:
            best = surface
        if good:
            break
        smooth = problem.values(x, steps=False)
        if np.max(np.abs(np.log(smooth) - problem.wanted)) > 0.5 * settings.tolerance:
            # The spectrum's form alone does not do it.
            if not problem.with_noise:
                problem.with_noise = True
                x = np.concatenate([x[_GAINS], problem.unknowns[_NOISE]])
        else:
            problem.wanted = original - np.log(surface.reached / smooth)
    assert best is not None
    return replace(best, demands=demands)
