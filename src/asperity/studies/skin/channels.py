r"""The skin's channels as filters: FA1, FA2 (Pacinian) and SA1, each by its threshold.

A channel responds to a vibration by the root of the summed squares of its lines, each over the
channel's threshold at its frequency; 1 is the threshold of detection. Displacements are peak
amplitudes at the skin.

The thresholds are straight lines in dB over octaves, recalled from the four-channel model of
Bolanowski, Gescheider, Verrillo & Checkosky (1988) and not checked against the source; beyond the
range in which a channel mediates detection they are asperity's:

    SA1 (NP III)   28 dB re 1 um up to 3 Hz, then 6 dB an octave more (asperity's)
    FA1 (NP I)     28 dB at 3 Hz, 5 dB an octave less up to 40 Hz, then 12 more (asperity's)
    FA2 (P)        -20 dB at 250 Hz, 12 dB an octave more below, and above (asperity's)

The envelope, the lowest of the three, agrees with another published curve, the one of the MPEG
haptics reference software (`runs.vibration_metrics.detection_threshold_db`): to 3.5 dB between 40
and 300 Hz, and to 8 dB between 10 and 500 Hz, once both have their lowest value at 0 dB.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity.errors import require_choice

CHANNELS = ("fa1", "fa2", "sa1")
_LEAST = 0.1
"""Frequencies below count as this [Hz]."""


def threshold_db(channel: str, frequencies: ArrayLike) -> NDArray[np.float64]:
    """Return the threshold of a channel [dB re 1 um, peak displacement] at frequencies [Hz]."""
    require_choice("channel", channel, CHANNELS)
    f = np.maximum(np.asarray(frequencies, dtype=np.float64), _LEAST)
    if channel == "sa1":
        return np.asarray(28.0 + 6.0 * np.maximum(np.log2(f / 3.0), 0.0))
    if channel == "fa1":
        falling = 28.0 - 5.0 * np.log2(np.minimum(f, 40.0) / 3.0)
        return np.asarray(falling + 12.0 * np.maximum(np.log2(f / 40.0), 0.0))
    return np.asarray(-20.0 + 12.0 * np.abs(np.log2(f / 250.0)))


def envelope_db(frequencies: ArrayLike) -> NDArray[np.float64]:
    """Return the lowest threshold of all channels [dB re 1 um]: that of detection."""
    return np.min([threshold_db(channel, frequencies) for channel in CHANNELS], axis=0)


def channel_level(
    channel: str, frequencies: NDArray[np.float64], displacements: NDArray[np.float64]
) -> float:
    """Return the response of a channel, in thresholds.

    Parameters
    ----------
    channel : str
        One of `CHANNELS`.
    frequencies : (n,) array
        [Hz]
    displacements : (n,) array
        Peak amplitudes at the skin [m].
    """
    threshold = 1e-6 * 10.0 ** (threshold_db(channel, frequencies) / 20.0)
    return float(np.sqrt(np.sum((displacements / threshold) ** 2)))
