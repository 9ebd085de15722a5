"""A designed surface: the map to make, what the process makes of it, and how far it misses."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from asperity._core.arrays import Array
from asperity.designing.forward import Demand, TouchBench
from asperity.designing.process import ManufactureProcess, MapLimits, map_limits
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError
from asperity.texture.height_field import HeightField

SLACK = 1.01
"""How much a limit of the process may be exceeded: what a soft constraint leaves."""


class UnreachableError(AsperityError):
    """A target that no surface of the given kind has; `nearest` is the surface that comes nearest.

    The nearest one is a `DesignedSurface`; to have it on disk, ask for a target that it has, or
    set `accept = "nearest"`.
    """

    def __init__(self, message: str, nearest: DesignedSurface) -> None:
        super().__init__(message)
        self.nearest = nearest


@dataclass(frozen=True)
class DesignSettings:
    """What all designs share.

    Parameters
    ----------
    process : ManufactureProcess
    hand : Hand
        Whose motion is designed.
    strokes : int
        Strokes over which a number is averaged.
    tolerance : float
        Largest relative miss of a value that counts as reached, above 0.
    candidates : int
        How many surfaces are returned at most.
    starts : int
        Places from which a search begins, 1 or more.
    seed : int
        Of these places, and of free maps.
    """

    process: ManufactureProcess = field(default_factory=ManufactureProcess)
    hand: Hand = field(default_factory=Hand)
    strokes: int = 3
    tolerance: float = 0.02
    candidates: int = 3
    starts: int = 6
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("strokes", "candidates", "starts"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise AsperityError(f"{name} must be a whole number, 1 or above, got {value!r}")
        if not 1e-4 <= self.tolerance <= 1.0:
            raise AsperityError(f"tolerance must lie between 0.0001 and 1, got {self.tolerance!r}")


@dataclass(frozen=True, eq=False)
class DesignedTile:
    """A map that repeats: `to_make` is for the machine, `made` is what comes out of it."""

    to_make: HeightField
    made: HeightField
    limits: MapLimits
    """Of `to_make`."""


@dataclass(frozen=True, eq=False)
class DesignedSurface:
    """Result of a search.

    Attributes
    ----------
    kind : str
        The pattern, or "free".
    parameters : dict
        The free parameters, in SI units.
    demands : tuple of Demand
    reached : (m,) array
        What the surface has of each demand, the process allowed for.
    tiles : dict
        By spacing [m]; None for demands without one.
    active : tuple of str
        Limits that the surface is at.
    """

    kind: str
    parameters: dict[str, float]
    demands: tuple[Demand, ...]
    reached: Array
    tiles: dict[float | None, DesignedTile]
    active: tuple[str, ...] = ()

    @property
    def misses(self) -> Array:
        """How far it misses each demand, relative to the wanted value (m,)."""
        wanted = np.array([demand.value for demand in self.demands])
        return self.reached / wanted - 1.0

    @property
    def worst(self) -> float:
        """Largest relative miss."""
        return float(np.max(np.abs(self.misses)))

    @property
    def tile(self) -> DesignedTile:
        """The tile of the first demand."""
        return self.tiles[self.demands[0].spacing]

    def summary(self) -> dict[str, Any]:
        """Return the surface as plain values, for reports."""
        return {
            "kind": self.kind,
            "parameters": self.parameters,
            "worst_miss": self.worst,
            "active_limits": list(self.active),
            "targets": [
                {"label": d.label, "unit": d.measure.unit, "wanted": d.value,
                 "reached": float(value), "miss": float(miss)}
                for d, value, miss in zip(self.demands, self.reached, self.misses, strict=True)
            ],
            "tiles": [
                {"spacing": spacing, "slope": tile.limits.slope, "relief": tile.limits.relief,
                 "feature": tile.limits.feature if np.isfinite(tile.limits.feature) else None,
                 "size": list(tile.to_make.size)}
                for spacing, tile in self.tiles.items()
            ],
        }  # fmt: skip


def designed_tile(samples: Array, pixel: float, process: ManufactureProcess) -> DesignedTile:
    """Return the tile of a map to make (rows, columns) [m] on square pixels."""
    size = (pixel, pixel)
    made = process.made(samples, size)
    return DesignedTile(
        HeightField(samples, pixel, "wrap"), HeightField(made, pixel, "wrap"),
        map_limits(samples, size),
    )  # fmt: skip


def at_limits(tile: DesignedTile, process: ManufactureProcess) -> tuple[str, ...]:
    """Return the limits of the process that a tile is at, or beyond."""
    near = 0.98
    out = []
    if tile.limits.slope > near * process.slope:
        out.append(f"slope {process.slope:.3g}")
    if tile.limits.relief > near * process.relief:
        out.append(f"relief {process.relief * 1e3:.3g} mm")
    return tuple(out)


def is_reached(surface: DesignedSurface, settings: DesignSettings) -> bool:
    """Return whether a surface has what is demanded, and the process can make it."""
    process = settings.process
    can_be_made = all(
        tile.limits.slope <= SLACK * process.slope and tile.limits.relief <= SLACK * process.relief
        for tile in surface.tiles.values()
    )
    return can_be_made and surface.worst <= settings.tolerance


def reached_or_refused(
    surfaces: list[DesignedSurface], settings: DesignSettings, accept_nearest: bool
) -> list[DesignedSurface]:
    """Return the surfaces that are reached, the nearest first; else the nearest, or refuse."""
    surfaces = sorted(surfaces, key=lambda surface: surface.worst)
    good = [surface for surface in surfaces if is_reached(surface, settings)]
    if good or accept_nearest:
        return good or surfaces[:1]
    raise unreachable(surfaces[0], settings.tolerance)


def unreachable(nearest: DesignedSurface, tolerance: float) -> UnreachableError:
    """Return the refusal of a target, which names the nearest that can be reached."""
    worst = int(np.argmax(np.abs(nearest.misses)))
    demand, value = nearest.demands[worst], nearest.reached[worst]
    unit = "" if demand.measure.unit == "1" else f" {demand.measure.unit}"
    held = f" within its limits ({', '.join(nearest.active)})" if nearest.active else ""
    shown = ", ".join(f"{name} = {one:.4g}" for name, one in nearest.parameters.items())
    wave = demand.speed / np.sqrt(np.prod(demand.measure.band))
    hint = ""
    is_low = demand.measure.metric == "band_rms" and value < demand.value
    if is_low and wave < 0.2 * demand.diameter:
        hint = (
            f"; the waves felt there are {wave * 1e3:.2g} mm long, shorter than a probe of "
            f"{demand.diameter * 1e3:.3g} mm follows"
        )
    return UnreachableError(
        f"{nearest.kind} cannot have {demand.value:.4g}{unit} ({demand.label}){held}: the nearest "
        f"has {value:.4g}{unit}, {100 * abs(nearest.misses[worst]):.3g} % off where "
        f"{100 * tolerance:.3g} % is allowed{f', with {shown}' if shown else ''}{hint}",
        nearest,
    )  # fmt: skip


def bench_of(demands: tuple[Demand, ...], settings: DesignSettings) -> TouchBench:
    """Return the bench that evaluates demands under settings."""
    return TouchBench(demands, settings.hand, settings.strokes)
