"""Acceleration as sound: WAV files for ears and for voice-coil actuators."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError, require_between, require_positive

if TYPE_CHECKING:
    import xarray as xr

PEAK = 10.0 ** (-1.0 / 20.0)
"""The largest sample stands 1 dB below full scale."""
LENGTHS = (0.05, 600.0)
"""The shortest and the longest sound [s]."""
_FADE = 0.01
_FEW = 4.0
"""With more samples of the sound than this to one of the record, lines between them are heard."""
_LARGEST_RATIO = 1000


@dataclass(frozen=True)
class Sound:
    """Samples between -1 and 1, and what they stand for."""

    samples: Array
    rate: int
    """[Hz]"""
    gain: float
    """Acceleration that full scale stands for [m/s^2]."""
    source: str
    """Where the acceleration came from, in words."""

    @property
    def level(self) -> float:
        """The RMS of the samples over full scale [dB]."""
        return 20.0 * math.log10(float(np.sqrt(np.mean(self.samples**2))))

    def write(self, path: Path | BinaryIO) -> None:
        """Write a 16-bit mono WAV file."""
        from scipy.io import wavfile  # slow to import, and the page starts with this module

        wavfile.write(path, self.rate, np.round(self.samples * 32767.0).astype(np.int16))


def from_acceleration(
    acceleration: Array,
    step: float,
    *,
    rate: int = 44100,
    seconds: float | None = None,
    repeats: bool = False,
    source: str = "",
) -> Sound:
    """Return acceleration, resampled and normalised, as sound.

    Parameters
    ----------
    acceleration : (n,) array
        u'' [m/s^2] at equal steps.
    step : float
        Time between samples [s].
    rate : int
        Of the sound [Hz], 1000 to 192000.
    seconds : float, optional
        Length of the sound, 0.05 to 600; the record is repeated if `repeats`, else cut. Default:
        the record once, or two seconds of repeats.
    repeats : bool
        Whether the record is one repeat of a periodic motion.
    """
    require_between("rate", rate, 1000, 192000, "[Hz]")
    require_positive("step", step, "[s]")
    record = step * acceleration.size
    if repeats:
        length = 2.0 if seconds is None else seconds
    else:
        length = min(LENGTHS[1] if seconds is None else seconds, record)
    require_between("seconds", length, *LENGTHS, "[s]")
    centred = acceleration - np.mean(acceleration)
    if not np.all(np.isfinite(centred)):
        raise AsperityError("the acceleration holds NaN or infinite values; give a whole run")
    if repeats:
        centred = np.tile(centred, math.ceil(length / record) + 2)
    centred = centred[: math.ceil(length / step) + 2]
    times = np.arange(max(int(length * rate), 2)) / rate
    if step * rate < 1.0:
        # More samples than the sound can hold: low-pass below half its rate first.
        from scipy import signal  # slow to import

        low_pass = signal.butter(8, 0.45 * rate, fs=1.0 / step, output="sos")
        centred = signal.sosfiltfilt(low_pass, centred)
    elif step * rate > _FEW:
        centred, step = _band_limited(centred, step, rate)
    samples = np.interp(times, np.arange(centred.size) * step, centred)
    fade = np.minimum(1.0, np.minimum(times, times[-1] - times) / _FADE)
    samples = samples * fade
    loudest = float(np.max(np.abs(samples)))
    if loudest == 0.0:
        raise AsperityError("the acceleration is zero throughout: there is nothing to hear")
    return Sound(samples * (PEAK / loudest), rate, loudest / PEAK, source)


def at_one_level(sounds: Sequence[Sound]) -> list[Sound]:
    """Return sounds at one level, the highest at which none exceeds `PEAK`, to be compared by ear.

    Level is the RMS of all samples. Sounds as `from_acceleration` makes them differ by how far
    their loudest sample stands out, which hides how smooth or rough they are.
    """
    rms = [float(np.sqrt(np.mean(sound.samples**2))) for sound in sounds]
    level = min(
        (
            PEAK * one / float(np.max(np.abs(sound.samples)))
            for sound, one in zip(sounds, rms, strict=True)
        ),
        default=0.0,
    )
    return [
        replace(sound, samples=sound.samples * (level / one), gain=sound.gain * one / level)
        for sound, one in zip(sounds, rms, strict=True)
    ]


def _band_limited(values: Array, step: float, rate: int) -> tuple[Array, float]:
    """Return values at about the rate of a sound, with nothing above half their own; the step.

    Lines between samples of a servo loop would add mirror images of its spectrum, which are heard
    as a hiss about the tick rate. A polyphase low-pass (Kaiser window, beta 5, 20 periods of the
    slower rate long) leaves 1 % of them.
    """
    from scipy import signal  # slow to import

    ratio = Fraction(step * rate).limit_denominator(_LARGEST_RATIO)
    out = signal.resample_poly(values, ratio.numerator, ratio.denominator)
    return np.asarray(out), step * ratio.denominator / ratio.numerator


def from_run(
    data: xr.Dataset,
    *,
    spacing: float | None = None,
    level: int | None = None,
    rate: int = 44100,
    seconds: float | None = None,
) -> Sound:
    """Return a run of a study, or a rub over a real surface, as sound.

    Parameters
    ----------
    data : xarray.Dataset
        As `asperity study` or `asperity demo` wrote it.
    spacing : float, optional
        Of a study: the nearest spacing [m] is taken. Default: where the middle level is largest.
    level : int, optional
        Of a study, the level of its factor, of a rub, the probe; from 0. Default: the middle.
    """
    if "acceleration" not in data:
        raise AsperityError(
            "the file holds no acceleration; give one that asperity study wrote "
            "(asperity export makes a WAV of a recording)"
        )
    acceleration = data["acceleration"]
    if "model" in acceleration.dims:
        data, acceleration = data.isel(model=0), acceleration.isel(model=0)
    first = acceleration.dims[0]
    count = data.sizes[first]
    chosen = (count - 1) // 2 if level is None else level
    if not 0 <= chosen < count:
        raise AsperityError(f"level must lie between 0 and {count - 1}, got {level}")
    if "time" in acceleration.dims:
        time = data["time"].values
        wave, step = acceleration.values[chosen], float(time[1] - time[0])
        repeats = int(data["status"].values[chosen]) == 0
        probe = f"probe {data['diameter'].values[chosen] * 1e3:g} mm"
        source = f"{data.attrs.get('title', 'rub')}, {probe}"
    else:
        spacings = data["spacing"].values
        if spacing is None:
            place = int(np.argmax(data["max_acceleration"].values[chosen]))
        else:
            require_positive("spacing", spacing, "[m]")
            place = int(np.argmin(np.abs(np.log(spacings / spacing))))
        wave, repeats = acceleration.values[chosen, place], True
        step = float(data["record_length"].values[chosen, place]) / wave.size
        factor = data.attrs["factor"]
        source = (
            f"study of {data.attrs['study']}, spacing {spacings[place] * 1e3:.3g} mm, "
            f"{factor} {float(data[factor].values[chosen]):.3g} {data[factor].attrs['units']}"
        )
    return from_acceleration(
        wave.astype(np.float64), step, rate=rate, seconds=seconds, repeats=repeats, source=source
    )
