r"""The texture force of Siira & Pai (1996): Gaussian noise while the probe slides.

Haptic textures: a stochastic approach, *Proc. IEEE ICRA*, 557-562. A new force is drawn at each
tick of the servo loop from N(0, sigma^2). Here sigma is `level` times the normal force, the
noise is low-passed to `bandwidth`, and the generator is seeded, so that a run can be repeated.

The model is quoted from other work and was not checked against the paper.

Limits: it has no geometry. The force depends on neither the probe's diameter nor the surface's
spacing, only on the chosen level of roughness.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError, require_positive


def texture_force(
    normal_force: float,
    duration: float,
    *,
    level: float = 0.2,
    rate: float = 1000.0,
    bandwidth: float = 300.0,
    seed: int = 0,
) -> NDArray[np.float64]:
    """Return F_u [N] at each tick of a servo loop, held constant between ticks.

    Parameters
    ----------
    normal_force : float
        Normal force on the probe [N], above 0.
    duration : float
        Length of the series [s].
    level : float
        Standard deviation of the force over the normal force, above 0; asperity's.
    rate : float
        Ticks per second.
    bandwidth : float
        Corner of the low-pass (second-order Butterworth) [Hz], below half the rate;
        asperity's.
    seed : int
        Seed of the generator.
    """
    from scipy import signal  # slow to import, and rarely needed

    require_positive("normal_force", normal_force, "[N]")
    require_positive("duration", duration, "[s]")
    require_positive("level", level)
    require_positive("rate", rate, "[Hz]")
    if not 0.0 < bandwidth < 0.5 * rate:
        raise AsperityError(
            f"bandwidth must lie between 0 and {0.5 * rate:g} Hz, got {bandwidth!r}"
        )
    noise = np.random.default_rng(seed).normal(size=math.ceil(duration * rate))
    smooth = signal.sosfilt(signal.butter(2, bandwidth, fs=rate, output="sos"), noise)
    return level * normal_force * smooth / np.std(smooth)
