"""Demands taken from something that exists: a spectrum, a surface, a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity.designing.candidate import DesignSettings, bench_of
from asperity.designing.forward import Demand
from asperity.designing.measures import VibrationMeasure
from asperity.designing.unknowns import square_samples
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError, require_between, require_positive
from asperity.runs.vibration_metrics import band_gain, spectrum
from asperity.scene.texture import body_texture

WEBER = 0.15
"""Just noticeable difference of a metric over its value, if none is given: asperity's. That of a
laboratory comes from `asperity analyse`."""
_HALF = 2.0 ** (1.0 / 6.0)
"""Half of a third octave."""
_MIDDLES = 31.5 * 2.0 ** (np.arange(12) / 3.0)
"""Middles of the third octaves that are taken from a recording, 31.5 to 400 Hz."""
_FAINT = 0.1
"""A third octave fainter than this share of the loudest is noise, and no target. asperity's."""


def spectrum_demands(
    frequencies: Sequence[float],
    levels: Sequence[float],
    quantity: str = "acceleration",
    **conditions: float,
) -> tuple[Demand, ...]:
    """Return demands for a spectrum.

    Parameters
    ----------
    frequencies, levels : sequences of equal length
        Middles of bands [Hz], and the RMS behind a second-order band-pass a third of an octave
        wide [m/s^2 or N].
    quantity : {"acceleration", "force"}
    **conditions
        Diameter [m], force [N], speed [m/s] of a `Demand`.
    """
    if len(frequencies) != len(levels) or not frequencies:
        raise AsperityError(
            f"frequencies and levels go together, got {len(frequencies)} and {len(levels)}"
        )
    out = []
    for middle, level in zip(frequencies, levels, strict=True):
        require_between("frequency", middle, 1.0, 2000.0, "Hz")
        band = (float(middle / _HALF), float(middle * _HALF))
        out.append(Demand(VibrationMeasure("band_rms", band, quantity), level, **conditions))
    return tuple(out)


def demands_like_surface(
    like: str | Mapping[str, Any],
    *,
    folder: Path,
    base: tuple[Demand, ...],
    settings: DesignSettings,
    jnd: float = 0.0,
    weber_fraction: float = WEBER,
) -> tuple[tuple[Demand, ...], tuple[str, ...]]:
    """Return demands for what a surface has, made `jnd` just noticeable differences rougher.

    Parameters
    ----------
    like : str or mapping
        A file of heights, or the table of a texture as in `scene.toml`. It is made periodic.
    folder : Path
        Of relative paths.
    base : tuple of Demand
        Measures and conditions; their values are replaced.
    settings : DesignSettings
        Hand and strokes.
    jnd : float
        Below 0 for a smoother one. Each multiplies the value by `1 + weber_fraction`.
    weber_fraction : float
        Above 0, at most 2.
    """
    require_between("jnd", jnd, -50.0, 50.0)
    require_between("weber_fraction", weber_fraction, 1e-3, 2.0)
    table = {"file": like} if isinstance(like, str) else dict(like)
    if "file" in table:
        table.setdefault("border", "wrap")
        table.setdefault("unit", "m")
    field, _ = body_texture(table, "like", folder)
    if field is None:
        raise AsperityError("like: a texture without relief has nothing to be like")
    samples, pixel = square_samples(field)
    if not np.ptp(samples) > 0.0:
        raise AsperityError("like: a flat surface has nothing to be like")
    values = bench_of(base, settings).values(samples, pixel)
    factor = (1.0 + weber_fraction) ** jnd
    out = tuple(
        replace(one, value=float(value) * factor) for one, value in zip(base, values, strict=True)
    )
    notes = list(field.notes)
    if jnd:
        notes.append(
            f"{jnd:g} just noticeable differences of {100 * weber_fraction:.3g} %: "
            f"{factor:.4g} times the surface's own values"
        )
    return out, tuple(notes)


def demands_like_recording(
    file: Path, hand: Hand, diameter: float = 3e-3, speed: float | None = None,
    force: float | None = None,
) -> tuple[tuple[Demand, ...], tuple[str, ...]]:  # fmt: skip
    """Return demands for the spectrum of the texture's force in a recording.

    Parameters
    ----------
    file : Path
        A recording of asperity.
    hand : Hand
        Only its mass: the recording's force over it is its vibration.
    diameter : float
        Of the tip that was recorded [m], which the file does not hold.
    speed, force : float, optional
        [m/s], [N]; the medians of the recording while it touched and moved.
    """
    from asperity.runs.recording import read_recording, recording_file
    from asperity.vibrotactile.signals import explored

    run = read_recording(recording_file(file))
    found = explored(
        run.time, run.tool_pose, run.contact_wrench, run.contact_count, mass=hand.mass,
        name=str(file),
    )  # fmt: skip
    moving = found.touching & (found.speed > 0.5 * np.median(found.speed[found.touching]))
    if np.count_nonzero(moving) < 0.2 * found.rate:
        raise AsperityError(f"{file}: it touches and moves for less than 0.2 s")
    speed = float(np.median(found.speed[moving])) if speed is None else speed
    force = float(np.median(found.force[moving])) if force is None else force
    require_positive("speed", speed, "[m/s]")
    require_positive("force", force, "[N]")
    vibration = found.vibration[np.flatnonzero(moving)[0] : np.flatnonzero(moving)[-1] + 1]
    frequencies, amplitudes = spectrum(vibration, 1.0 / found.rate, periodic=False)
    middles = [f for f in _MIDDLES if f < 0.4 * found.rate]
    bands = [(f / _HALF, f * _HALF) for f in middles]
    powers = 0.5 * (hand.mass * amplitudes) ** 2
    levels = np.sqrt([np.sum(powers * band_gain(frequencies, band)) for band in bands])
    # What a band-pass lets through from its neighbours is no feature of the surface.
    within = np.sqrt([
        np.sum(powers[(low <= frequencies) & (frequencies < high)]) for low, high in bands
    ])  # fmt: skip
    heard = within > _FAINT * within.max()
    demands = spectrum_demands(
        [f for f, one in zip(middles, heard, strict=True) if one], list(levels[heard]),
        "force", diameter=diameter, speed=speed, force=force,
    )  # fmt: skip
    note = (
        f"the recording moves at {speed * 1e3:.4g} mm/s and presses with {force:.3g} N (medians); "
        f"{int(heard.sum())} third octaves of its force, {middles[0]:.3g} to {middles[-1]:.3g} Hz, "
        f"are the target; its tip is taken to be {diameter * 1e3:.3g} mm wide"
    )
    return demands, (note,)
