"""Drag probes of several sizes over one real surface: profile, offset, vibration, spectrum."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from asperity.dynamics.dragged_hand.hand import Hand, drag
from asperity.errors import AsperityError
from asperity.geometry.offsets.sampled import HeightMap
from asperity.runs.vibration_metrics import DEFAULT_BAND, METRICS, evaluate
from asperity.studies.otaduy_lin_2004.force_models.otaduy_lin import slope_table

if TYPE_CHECKING:
    import xarray as xr

_RATE = 8000.0
_SEGMENT = 0.125
_TABLE_TOLERANCE = 3e-3
"""Relative to the largest slope; well below the accuracy of any measured map."""
_MAX_PIXELS_SHOWN = 400


def rub(
    surface: HeightMap,
    *,
    title: str,
    diameters: Sequence[float] = (1e-3, 2e-3, 3e-3, 4e-3),
    normal_force: float = 0.58,
    speed: float = 0.083,
    hand: Hand | None = None,
    band: tuple[float, float] = DEFAULT_BAND,
    shown: float = 4e-3,
    progress: Callable[[], None] | None = None,
) -> xr.Dataset:
    """Drag probes over a height map; return offsets, vibrations and their spectra.

    Measured surfaces do not repeat, so they are continued by reflection, with twice their length as
    period. The record begins when the motion is periodic, or when it is clear that it is not.

    Parameters
    ----------
    surface : HeightMap
        The surface; probes are dragged along its `line`.
    title : str
        Title of the figure.
    diameters : sequence of float
        Diameters of the probes [m].
    normal_force, speed, hand
        As in the studies: [N], [m/s].
    band : (low, high)
        Band of the metric `band_rms` [Hz].
    shown : float
        Length of path for which profile and offsets are returned [m].
    progress : callable, optional
        Called after each probe.

    Returns
    -------
    xarray.Dataset
        `profile(u)`, `offset(diameter, u)` [m] over the first `shown` metres;
        `acceleration(diameter, time)` [m/s^2] at 8 kHz; `spectrum(diameter, frequency)`
        [m/s^2/sqrt(Hz)], Welch; the metrics by `diameter`; `heights` for a picture.
    """
    from scipy import signal  # slow to import, and seldom needed

    if not diameters:
        raise AsperityError("rub needs at least one diameter")
    hand = hand or Hand()
    u = np.linspace(0.0, min(shown, surface.length), 1600)
    offsets, waves, spectra = [], [], []
    figures: dict[str, list[float]] = {name: [] for name in METRICS}
    status = []
    seconds = surface.period / speed
    time = np.arange(round(seconds * _RATE)) / _RATE
    frequency = np.zeros(0)
    for diameter in diameters:
        trace = surface.tracer(diameter)
        offsets.append(trace(u).height)
        slope = slope_table(surface, diameter, tolerance=_TABLE_TOLERANCE, trace=trace)
        motion = drag(slope.scaled(normal_force), hand, speed)
        wave = np.interp(
            time, np.arange(motion.acceleration.size) * motion.step, motion.acceleration
        )
        waves.append(wave)
        segment = min(round(_SEGMENT * _RATE), wave.size)
        frequency, power = signal.welch(wave, _RATE, nperseg=segment)
        spectra.append(np.sqrt(power))
        for name, values in figures.items():
            values.append(evaluate(name, motion, band=band))
        status.append(int(motion.status))
        if progress:
            progress()
    step = max(1, max(surface.samples.shape) // _MAX_PIXELS_SHOWN)
    data = {
        "profile": ("u", surface.heights(u), {"units": "m"}),
        "offset": (("diameter", "u"), np.array(offsets), {"units": "m"}),
        "acceleration": (("diameter", "time"), np.array(waves), {"units": "m/s²"}),
        "spectrum": (("diameter", "frequency"), np.array(spectra), {"units": "m/s²/√Hz"}),
        "status": ("diameter", np.array(status), {"units": "1"}),
        "heights": (("row", "column"), surface.samples[::step, ::step], {"units": "m"}),
    } | {
        name: ("diameter", np.array(values), {"units": METRICS[name].unit})
        for name, values in figures.items()
    }
    coords = {
        "u": ("u", u, {"units": "m"}),
        "diameter": ("diameter", np.array(diameters), {"units": "m"}),
        "time": ("time", time, {"units": "s"}),
        "frequency": ("frequency", frequency, {"units": "Hz"}),
    }
    rows, columns = surface.samples.shape
    assert surface.line is not None
    attrs = {
        "schema": 1,
        "title": title,
        "speed": speed,
        "normal_force": normal_force,
        "hand_mass": hand.mass,
        "hand_stiffness": hand.stiffness,
        "hand_damping": hand.damping,
        "band": list(band),
        "line": surface.line,
        "map_length": columns * surface.pixel_size,
        "map_width": rows * surface.pixel_size,
    }
    import xarray as xr  # slow to import: the probes have been rubbed by now

    return xr.Dataset(data, coords, attrs)
