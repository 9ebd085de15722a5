"""Random textures for tests."""

import numpy as np

from asperity.texture.height_field import HeightField


def bumps(seed=0, rms=4e-5):
    """Return a random wrapped texture with waves of 1 mm and more."""
    rng = np.random.default_rng(seed)
    n, size = 96, 6e-3
    k = np.fft.fftfreq(n) * n
    keep = np.hypot(k[:, None], k[None, :]) <= 6
    heights = np.fft.ifft2(np.fft.fft2(rng.standard_normal((n, n))) * keep).real
    return HeightField(heights * (rms / heights.std()), pixel_size=size / n)
