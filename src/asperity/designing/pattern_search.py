"""The search for the parameters of a pattern.

Least squares of the logarithms of value over wanted value, with limits of the process as further
residuals, from several starts; if none ends within the tolerance, differential evolution and
least squares once more. Derivatives are differences: there are few parameters, and a pattern's
generator has no adjoint.

Layers make the numbers jump with the parameters. So the search takes the process without them, and
its targets are then corrected by what the layers change, until the surface with layers is right.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from asperity._core.arrays import Array
from asperity.designing.candidate import (
    DesignedSurface,
    DesignSettings,
    at_limits,
    bench_of,
    designed_tile,
    reached_or_refused,
)
from asperity.designing.forward import Demand
from asperity.designing.process import facet_slopes
from asperity.designing.unknowns import PatternUnknown, square_samples
from asperity.errors import AsperityError

_STEP = 1e-3
"""Of the differences, in unknowns."""
_ENOUGH = 0.1
"""A search ends at this share of the tolerance."""
_PENALTY = 10.0
_FAILED = 5.0
"""Residual of a surface that cannot be made or dragged over: e^5 times the wanted value."""
_ROUNDS = 4
_EVOLUTIONS, _POPULATION = 8, 6
Tell = Callable[[str, float], None]
"""Called with what is done and the largest relative miss so far."""


class _EnoughError(Exception):
    """The target is met: a solver need not go on."""


class _Problem:
    """Residuals of one pattern, and the best that was seen."""

    def __init__(
        self, unknown: PatternUnknown, demands: tuple[Demand, ...], settings: DesignSettings,
        tell: Tell | None,
    ) -> None:  # fmt: skip
        self.unknown, self.settings, self._tell = unknown, settings, tell
        self.demands = demands
        spacings = list(dict.fromkeys(demand.spacing for demand in demands))
        self._groups = [
            (s, [i for i, demand in enumerate(demands) if demand.spacing == s]) for s in spacings
        ]
        self._benches = [
            bench_of(tuple(demands[i] for i in rows), settings) for _, rows in self._groups
        ]
        self.best: tuple[float, Array] = (np.inf, np.full(len(unknown.names), 0.5))
        self.wanted = np.log([demand.value for demand in demands])

    def values(self, x: Array, *, steps: bool) -> tuple[Array, Array]:
        """Return the numbers (m,) at unknowns, and by how much limits are exceeded (2 s,)."""
        process, found = self.settings.process, np.zeros(len(self.demands))
        over = []
        for (spacing, rows), bench in zip(self._groups, self._benches, strict=True):
            samples, pixel = square_samples(self.unknown.field(x, spacing))
            sizes = (pixel, pixel)
            samples = process.to_make(samples, sizes)
            slope = float(facet_slopes(samples, sizes, wraps=True).max())
            over += [slope / process.slope - 1.0, float(np.ptp(samples)) / process.relief - 1.0]
            found[rows] = bench.values(process.made(samples, sizes, steps=steps), pixel)
        return found, np.maximum(over, 0.0)

    def residuals(self, x: Array) -> Array:
        """Return the residuals at unknowns; raise `_EnoughError` where they are small."""
        x = np.clip(x, 0.0, 1.0)
        try:
            found, over = self.values(x, steps=False)
        except AsperityError:
            return np.full(len(self.demands) + 2 * len(self._groups), _FAILED)
        out = np.concatenate([np.log(np.maximum(found, 1e-12)) - self.wanted, _PENALTY * over])
        cost = float(np.max(np.abs(out)))
        if cost < self.best[0]:
            self.best = cost, np.array(x)
            if self._tell is not None:
                self._tell(self.unknown.kind, cost)
            if cost < _ENOUGH * self.settings.tolerance:
                raise _EnoughError
        return out

    def jacobian(self, x: Array) -> Array:
        """Return the derivatives of the residuals by differences."""
        here = self.residuals(x)
        columns = []
        for i in range(x.size):
            step = _STEP if x[i] < 0.5 else -_STEP
            moved = np.array(x)
            moved[i] += step
            columns.append((self.residuals(moved) - here) / step)
        return np.stack(columns, axis=1)

    def surface(self, x: Array) -> DesignedSurface:
        """Return the surface at unknowns, with layers."""
        process = self.settings.process
        found, _ = self.values(x, steps=True)
        tiles = {}
        active: list[str] = []
        for spacing, _rows in self._groups:
            samples, pixel = square_samples(self.unknown.field(x, spacing))
            tile = designed_tile(process.to_make(samples, (pixel, pixel)), pixel, process)
            tiles[spacing] = tile
            active += at_limits(tile, process)
        for value, (name, (low, high)) in zip(x, self.unknown.free.items(), strict=True):
            if not 1e-3 < value < 1.0 - 1e-3:
                active.append(f"{name} {low if value < 0.5 else high:.4g}")
        return DesignedSurface(
            self.unknown.kind, self.unknown.parameters(x), self.demands, found, tiles,
            tuple(dict.fromkeys(active)),
        )  # fmt: skip


def _starts(unknown: PatternUnknown, settings: DesignSettings, first: Array | None) -> list[Array]:
    from scipy.stats import qmc

    count = settings.starts - (first is not None)
    points = qmc.Halton(len(unknown.names), rng=settings.seed).random(max(count, 1))
    points = 0.08 + 0.84 * points
    return ([first] if first is not None else []) + list(points[:count])


def _search(problem: _Problem, start: Array) -> float:
    """Search from a start; return the largest residual, and leave its place in `problem.best`."""
    from scipy.optimize import least_squares

    problem.best = (np.inf, start)
    with contextlib.suppress(_EnoughError):
        least_squares(
            problem.residuals, np.clip(start, 1e-6, 1.0 - 1e-6), problem.jacobian, (0.0, 1.0),
            xtol=1e-5, ftol=1e-6, max_nfev=25,
        )  # fmt: skip
    return problem.best[0]


def _evolve(problem: _Problem, start: Array) -> None:
    """Search globally, then locally, from `start`."""
    from scipy.optimize import Bounds, differential_evolution

    def cost(x: Array) -> float:
        return float(np.sum(problem.residuals(x) ** 2))

    problem.best = (np.inf, start)
    try:
        differential_evolution(
            cost, Bounds([0.0] * start.size, [1.0] * start.size),
            x0=np.clip(start, 0.0, 1.0), maxiter=_EVOLUTIONS, popsize=_POPULATION,
            rng=problem.settings.seed, polish=False, tol=0.0,
        )  # fmt: skip
    except _EnoughError:
        return
    before = problem.best
    _search(problem, before[1])
    if before[0] < problem.best[0]:
        problem.best = before


def search_pattern(
    unknown: PatternUnknown,
    demands: tuple[Demand, ...],
    settings: DesignSettings,
    *,
    start: Mapping[str, float] | None = None,
    accept_nearest: bool = False,
    tell: Tell | None = None,
) -> list[DesignedSurface]:
    """Return surfaces of a pattern that have what is demanded, the nearest first.

    Parameters
    ----------
    unknown : PatternUnknown
    demands : tuple of Demand
        One or more.
    settings : DesignSettings
    start : mapping, optional
        Free parameters from which the search begins, within their ranges.
    accept_nearest : bool
        Whether the nearest surface is returned where none is near enough.
    tell : callable, optional
        Called with the pattern's name and the largest relative miss so far.

    Raises
    ------
    UnreachableError
        No surface within the tolerance was found.
    """
    if not demands:
        raise AsperityError("a design needs at least one target value")
    problem = _Problem(unknown, demands, settings, tell)
    first = None if start is None else np.clip(unknown.unknowns(start), 0.0, 1.0)
    places: list[tuple[float, Array]] = []
    for place in _starts(unknown, settings, first):
        cost = _search(problem, place)
        places.append((cost, problem.best[1]))
        if sum(cost <= settings.tolerance for cost, _ in places) >= settings.candidates:
            break
    places.sort(key=lambda one: one[0])
    if places[0][0] > settings.tolerance:
        _evolve(problem, places[0][1])
        places.insert(0, problem.best)
    places = [one for one in places if one[0] <= settings.tolerance] or places[:1]
    apart: list[Array] = []
    for _, place in places:
        if all(np.max(np.abs(place - other)) > 0.02 for other in apart):
            apart.append(place)
    surfaces = [_with_layers(problem, place) for place in apart[: settings.candidates]]
    return reached_or_refused(surfaces, settings, accept_nearest)


def _with_layers(problem: _Problem, x: Array) -> DesignedSurface:
    """Return the surface at unknowns, moved until it is right with layers."""
    best = problem.surface(x)
    if problem.settings.process.layer == 0.0:
        return best
    original = np.array(problem.wanted)
    shift = np.zeros(original.size)
    for _ in range(_ROUNDS):
        if best.worst <= 0.5 * problem.settings.tolerance:
            break
        smooth, _ = problem.values(x, steps=False)
        stepped, _ = problem.values(x, steps=True)
        shift = np.log(stepped / smooth)
        problem.wanted = original - shift
        _search(problem, x)
        x = problem.best[1]
        surface = problem.surface(x)
        if surface.worst < best.worst:
            best = surface
    problem.wanted = original
    return best


def at_parameters(
    unknown: PatternUnknown,
    parameters: Mapping[str, float],
    demands: tuple[Demand, ...],
    settings: DesignSettings,
) -> DesignedSurface:
    """Return the surface of given free parameters, without a search."""
    problem = _Problem(unknown, demands, settings, None)
    return problem.surface(unknown.unknowns(parameters))


def demands_of(surface: DesignedSurface) -> tuple[Demand, ...]:
    """Return demands for exactly what a surface has."""
    return tuple(
        replace(demand, value=float(value))
        for demand, value in zip(surface.demands, surface.reached, strict=True)
    )
