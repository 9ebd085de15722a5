"""A design from its request to its folder: search, judge, write."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.arrays import Array
from asperity._core.output import result_folder, write_json
from asperity.designing.candidate import DesignedSurface
from asperity.designing.forward import Demand
from asperity.designing.free_map import FreeMap, search_free_map
from asperity.designing.judge import EnsembleValues, check_in_six_dof, over_ensemble
from asperity.designing.pattern_search import search_pattern
from asperity.designing.report import write_report
from asperity.designing.series import Evenness, evenness, search_series
from asperity.designing.surface_folder import write_surface
from asperity.designing.target_file import DesignRequest, read_request
from asperity.designing.unknowns import PatternUnknown
from asperity.errors import AsperityError
from asperity.studies.ensemble.members import ensemble_hands
from asperity.texture.height_field import HeightField

Progress = Callable[[str, float], None]
_CHECKED = 3
"""Demands of a surface that are checked in six degrees of freedom, at most."""


@dataclass(frozen=True, eq=False)
class DesignResult:
    """Result of `design`.

    Attributes
    ----------
    folder : Path or None
        None if nothing was written.
    surfaces : tuple of DesignedSurface
        Candidates, the nearest first; for metamers the best of each look; for a series, in order.
    report : dict
        Contents of `design.json`.
    """

    folder: Path | None
    surfaces: tuple[DesignedSurface, ...]
    report: dict[str, Any]


def design(
    target: str | os.PathLike[str] | Mapping[str, Any],
    out: str | os.PathLike[str] | None = None,
    *,
    six_dof: bool = True,
    overwrite: bool = False,
    on_progress: Progress | None = None,
) -> DesignResult:
    """Find surfaces that have a wanted roughness, spectrum or distance, ready to print.

    Parameters
    ----------
    target : path or mapping
        A TOML file, or a mapping of the same keys; see `docs/design.md`.
    out : path, optional
        Folder to create, with a folder for each surface; nothing is written without it.
    six_dof : bool
        Whether the surfaces are dragged over in six degrees of freedom as well.
    overwrite : bool
        Whether files in `out` may be replaced.
    on_progress : callable, optional
        Called with what is done and the share of the whole work, 0 to 1.

    Returns
    -------
    DesignResult

    Raises
    ------
    UnreachableError
        No surface within the limits has what is wanted; the message has the nearest.
    AsperityError
        A request that makes no sense, a folder that cannot be written; one line.

    Examples
    --------
    >>> made = asperity.design({"target": {"value": 1.5}, "surface": {"pattern": "knurl"}}, "k")
    >>> made.surfaces[0].parameters
    """
    request = read_request(target)
    tell = on_progress or (lambda what, share: None)
    surfaces, seeds = _searched(request, tell)
    if out is None:
        return DesignResult(None, surfaces, {"surfaces": [one.summary() for one in surfaces]})
    with result_folder(Path(out), overwrite=overwrite) as folder:
        report = _written(request, surfaces, seeds, folder, six_dof, tell)
        tell("done", 1.0)
    return DesignResult(Path(out), surfaces, report)


def _searched(
    request: DesignRequest, tell: Progress
) -> tuple[tuple[DesignedSurface, ...], list[PatternUnknown | None]]:
    """Return the surfaces, and for each the unknown whose other seeds are its variants."""
    several = len(request.unknowns) > 1
    settings = request.settings
    if several:
        settings = replace(settings, candidates=1)
    surfaces: list[DesignedSurface] = []
    seeds: list[PatternUnknown | None] = []

    def searching(what: str, miss: float) -> None:
        share = 0.5 * len(surfaces) / max(len(request.unknowns), 1)
        tell(f"{what}: {100 * miss:.2g} % off", share)

    for unknown, start in zip(request.unknowns, request.starts, strict=True):
        if request.series is not None:
            if isinstance(unknown, FreeMap) or several:
                raise AsperityError("a series needs one [[surface]] with a pattern")
            found, alone = search_series(
                unknown, request.series.values(), request.demands[0], request.settings,
                hands=ensemble_hands(), log=request.series.scale == "log", tell=searching,
            )  # fmt: skip
            surfaces += found
            seeds += [alone] * len(found)
        elif isinstance(unknown, FreeMap):
            free_settings = replace(settings, tolerance=request.free_tolerance)
            maps = search_free_map(
                unknown, request.demands, free_settings, accept_nearest=request.accept_nearest,
                tell=searching,
            )  # fmt: skip
            surfaces += maps
            seeds += [None] * len(maps)
        else:
            found = search_pattern(
                unknown, request.demands, settings, start=start,
                accept_nearest=request.accept_nearest, tell=searching,
            )  # fmt: skip
            surfaces += found
            seeds += [unknown] * len(found)
    return tuple(surfaces), seeds


def _variants(
    surface: DesignedSurface, unknown: PatternUnknown | None, spacing: float | None,
    request: DesignRequest,
) -> list[tuple[str, HeightField, float]]:  # fmt: skip
    """Return the surface, strokes that the search has not seen, and another seed."""
    made = surface.tiles[spacing].made
    variants = [("as designed", made, 0.0)]
    if request.settings.strokes > 1 or unknown is None:
        variants.append(("other strokes", made, 0.5))
    if unknown is not None and unknown.kind in ("jittered_dots", "rough"):
        seed = int(unknown.fixed.get("seed", 0)) + 1
        other = PatternUnknown(unknown.kind, unknown.free, {**unknown.fixed, "seed": seed})
        field = other.field(other.unknowns(surface.parameters), spacing)
        process = request.settings.process
        to_make = process.to_make(np.array(field.samples), field.pixel_size)
        made = HeightField(process.made(to_make, field.pixel_size), field.pixel_size, "wrap")
        variants.append((f"seed {seed}", made, 0.0))
    return variants


def _written(
    request: DesignRequest, surfaces: tuple[DesignedSurface, ...],
    seeds: list[PatternUnknown | None], folder: Path, six_dof: bool, tell: Progress,
) -> dict[str, Any]:  # fmt: skip
    """Write everything; return the report."""
    settings, hands = request.settings, ensemble_hands()
    entries: list[dict[str, Any]] = []
    ensembles: list[EnsembleValues] = []
    for i, (surface, unknown) in enumerate(zip(surfaces, seeds, strict=True)):
        begin, width = 0.5 + 0.45 * i / len(surfaces), 0.45 / len(surfaces)
        entry = surface.summary()
        entry["plates"], entry["six_dof"], entry["variants"] = [], [], []
        for k, spacing in enumerate(surface.tiles):
            demands = tuple(d for d in surface.demands if d.spacing == spacing)
            number = str(i + 1) if len(surface.tiles) == 1 else f"{i + 1}.{k + 1}"
            inside = folder / number
            inside.mkdir()
            tell(f"plate {number}", begin)
            tile = surface.tiles[spacing]
            scene, written = write_surface(
                tile, demands[0], settings.process, request.plate, number, inside
            )
            if request.mesh is not None:
                from asperity.designing.plate_stl import write_on_mesh

                written["mesh"] = write_on_mesh(
                    request.mesh, tile.to_make, settings.process, inside
                )
            entry["plates"].append(written)
            values = over_ensemble(
                _variants(surface, unknown, spacing, request), demands, hands, settings.strokes,
                _share_of(tell, begin, width),
            )  # fmt: skip
            ensembles.append(values)
            entry["variants"].append(_ensemble_entry(values, demands))
            if six_dof:
                tell(f"6-DoF {number}", begin + width)
                for demand in _apart(demands):
                    check = check_in_six_dof(
                        scene, tile.made, demand, settings.hand, settings.strokes
                    )
                    if check is not None:
                        entry["six_dof"].append(check._asdict() | {"difference": check.difference})
        entries.append(entry)
    report: dict[str, Any] = {
        "schema": 1,
        "kind": request.kind,
        "process": settings.process.__dict__,
        "hand": settings.hand.__dict__,
        "tolerance": settings.tolerance,
        "strokes": settings.strokes,
        "notes": list(request.notes),
        "surfaces": entries,
    }
    if request.series is not None:
        of_hands = np.array([one.values[0, :, 0] for one in ensembles])
        judged = evenness(of_hands, log=request.series.scale == "log")
        report["series"] = _series_entry(judged, of_hands)
    write_json(folder / "design.json", report)
    write_report(report, surfaces, ensembles, folder)
    return report


def _share_of(tell: Progress, begin: float, width: float) -> Callable[[float], None]:
    return lambda share: tell("ensemble", begin + width * share)


def _apart(demands: tuple[Demand, ...]) -> tuple[Demand, ...]:
    """Return demands spread over all, those that a check in six degrees of freedom is made of."""
    if len(demands) <= _CHECKED:
        return demands
    return tuple(demands[round(i)] for i in np.linspace(0, len(demands) - 1, _CHECKED))


def _ensemble_entry(values: EnsembleValues, demands: tuple[Demand, ...]) -> list[dict[str, Any]]:
    out = []
    for name, of_hands in zip(values.variants, values.values, strict=True):
        for k, demand in enumerate(demands):
            one = of_hands[:, k]
            dragged = one[np.isfinite(one)]
            low, middle, high = (
                np.percentile(dragged, (10, 50, 90)).tolist() if dragged.size else (None,) * 3
            )
            out.append({
                "variant": name, "label": demand.label, "unit": demand.measure.unit,
                "p10": low, "median": middle, "p90": high, "hands": int(dragged.size),
            })  # fmt: skip
    return out


def _series_entry(judged: Evenness, values: Array) -> dict[str, Any]:
    finite = np.where(np.isfinite(judged.uneven), judged.uneven, -1.0)
    return {
        "share_even_within_5_percent": judged.share(),
        "share_monotonic": float(np.mean(judged.monotonic)),
        "uneven": [None if one < 0.0 else float(one) for one in finite],
        "values": [[None if not np.isfinite(v) else float(v) for v in row] for row in values],
    }
