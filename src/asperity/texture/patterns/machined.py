"""Textures of dots, teeth, knurls and scratches; for common parameters see `patterns`.

Two-dimensional shapes are made with sharp edges, rounded over `fillet` by a Gaussian weight, and
scaled back to the given height.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.errors import AsperityError, require_between, require_not_negative, require_positive
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.fillets import (
    FEWEST,
    checked_fillet,
    require_fits,
    require_whole,
    rounded,
    smoothed,
    tile,
)

MOST_SCRATCHES = 20_000


def jittered_dots(
    *,
    pitch: float,
    height: float,
    diameter: float,
    flank: float | None = None,
    jitter: float = 0.5,
    fillet: float | None = None,
    seed: int = 0,
    periods: int = 8,
    samples: int = 48,
) -> HeightField:
    """Return raised dots, truncated cones on a jittered square lattice; the ground lies at 0.

    Such plates are the stimuli of the studies of roughness felt through a probe. The dots do not
    overlap.

    Parameters
    ----------
    pitch : float
        Mean distance between the middles of neighbouring dots [m], above 0.
    height : float
        Of the dots [m], 0 or above.
    diameter : float
        Of a dot's top [m], up to the middle of its rounding, above 0; wider than a fillet.
    flank : float, optional
        Width of the sloping side in plan [m], between the middles of its roundings: a fillet or
        more. A fillet if not given.
    jitter : float
        Each dot is moved along u and v by up to this share of half the gap between neighbouring
        feet, 0 to 1, uniformly.
    fillet : float, optional
        Length of each rounding [m], 2 samples or more. A sixteenth of the pitch if not given.
    seed : int
        Of the jitter, 0 or above.
    periods, samples : int
        Dots along each side of the tile, 1 or more, and samples in each pitch, 8 or more.

    References
    ----------
    Klatzky & Lederman (1999), "Tactile roughness perception with a rigid link interposed between
    skin and surface", Perception & Psychophysics 61, 591-607.
    """
    require_positive("pitch", pitch, "[m]")
    require_not_negative("height", height, "[m]")
    require_between("jitter", jitter, 0.0, 1.0)
    for name, value, least in (("periods", periods, 1), ("samples", samples, FEWEST)):
        require_whole(name, value, least)
    fillet = checked_fillet(fillet, pitch, samples)
    flank = fillet if flank is None else require_positive("flank", flank, "[m]")
    if flank < fillet * (1.0 - 1e-9):
        raise AsperityError(f"flank must be a fillet ({fillet:.4g} m) or more, got {flank!r}")
    require_fits("diameter", diameter, pitch - 2.0 * flank, fillet)
    (u, v), pixel_size = tile((periods * pitch, periods * pitch), pitch / samples)
    foot = 0.5 * (diameter + fillet) + flank
    shift = jitter * max(0.0, 0.5 * pitch - foot)
    moves = _generator(seed).uniform(-shift, shift, (2, periods, periods))
    lattice = (np.arange(periods) + 0.5) * pitch
    heights = np.zeros((v.size, u.size))
    outline = [(-0.5 * diameter - flank, 0.0), (-0.5 * diameter, height)]
    outline += [(-x, h) for x, h in reversed(outline)]
    for row, column in np.ndindex(periods, periods):
        at = lattice[column] + moves[0, row, column], lattice[row] + moves[1, row, column]
        window = _window(at, (foot, foot), pixel_size)
        (columns, x), (rows, y) = window
        # The outline as one period of a polyline, long enough that its ends do not meet.
        period = 4.0 * foot
        phase = np.hypot(x[None, :], y[:, None]) / period
        dot = rounded(phase, [(r / period, h) for r, h in outline], fillet / period)
        heights[np.ix_(rows % v.size, columns % u.size)] += dot
    return HeightField(heights, pixel_size, "wrap")


def cross_cut(
    *,
    pitch: float,
    height: float,
    second_pitch: float | None = None,
    angles: tuple[float, float] = (math.radians(45.0), math.radians(70.0)),
    face: float = 0.25,
    fillet: float | None = None,
    variation: float = 0.0,
    periods: int = 12,
    samples: int = 48,
    seed: int = 0,
) -> HeightField:
    """Return the teeth of a double-cut file: two crossed sets of saw-tooth grooves.

    Each cut leaves teeth with a long back and a steep face, which points to +u, the file's tip.
    What both cuts leave standing are rows of pointed teeth. The cuts' angles are those of common
    hand files.

    Parameters
    ----------
    pitch : float
        From tooth to tooth of the first cut, across it [m], above 0.
    height : float
        From the lowest to the highest point [m], 0 or above.
    second_pitch : float, optional
        Of the second cut [m]; 0.85 pitches if not given. The nearest that repeats over the tile
        is taken; the notes give it.
    angles : (float, float)
        Of the two cuts to the file's axis, u, on either side of it [rad]: 0.2 to 1.5.
    face : float
        Share of a pitch that the steep face takes, 0.1 to 0.9.
    fillet : float, optional
        Length over which creases are rounded [m], 2 samples or more; a sixteenth of the pitch if
        not given.
    variation : float
        Standard deviation of the teeth's heights, as a share of their mean, 0 to 0.3: no two
        teeth of a real file are cut, or worn, alike.
    periods, samples : int
        Pitches along each side of the tile, about, 2 or more; samples in each, 8 or more.
    seed : int
        Of the variation.
    """
    require_positive("pitch", pitch, "[m]")
    require_not_negative("height", height, "[m]")
    require_between("face", face, 0.1, 0.9)
    require_between("variation", variation, 0.0, 0.3)
    second = 0.85 * pitch if second_pitch is None else second_pitch
    require_positive("second_pitch", second, "[m]")
    for name, value, least in (("periods", periods, 2), ("samples", samples, FEWEST)):
        require_whole(name, value, least)
    if not isinstance(angles, tuple | list) or len(angles) != 2:
        raise AsperityError(f"angles must be two angles [rad], got {angles!r}")
    for angle in angles:
        require_between("angles", angle, 0.2, 1.5, "[rad]")
    fillet = checked_fillet(fillet, pitch, samples)
    # Waves across the cuts: the first fits the tile exactly, the second nearly.
    first_k = np.array([math.sin(angles[0]), math.cos(angles[0])]) / pitch
    second_k = np.array([math.sin(angles[1]), math.cos(angles[1])]) / second
    counts = np.maximum(np.round(periods * pitch * first_k), 1.0)
    sides = counts / first_k
    second_counts = np.maximum(np.round(sides * second_k), 1.0)
    second_k = second_counts / sides
    (u, v), pixel_size = tile((sides[0], sides[1]), min(pitch, second) / samples)
    corners = [(0.0, 0.0), (1.0 - face, 1.0)]
    teeth = [
        rounded(k[0] * u + sign * k[1] * v, corners, fillet * float(np.hypot(*k)))
        for k, sign in ((first_k, 1.0), (second_k, -1.0))
    ]
    angle = math.degrees(math.atan2(second_k[0], second_k[1]))
    note = f"second cut: pitch {1e6 / np.hypot(*second_k):.4g} um at {angle:.3g} degrees to u"
    heights = smoothed(np.minimum(*teeth), pixel_size, fillet)
    if variation > 0.0:
        uneven = _smooth_noise(heights.shape, pixel_size, 0.5 * pitch, _generator(seed))
        heights = (heights - heights.min()) * (1.0 + variation * uneven)
    return HeightField(_scaled(heights, height), pixel_size, "wrap", (note,))


def knurl(
    *,
    pitch: float,
    height: float,
    angle: float = math.radians(30.0),
    flat: float = 0.1,
    fillet: float | None = None,
    periods: int = 6,
    samples: int = 48,
) -> HeightField:
    """Return a diamond knurl: pyramids between two crossed sets of V-shaped grooves.

    Parameters
    ----------
    pitch : float
        From groove to groove, across them [m], above 0.
    height : float
        From the lowest to the highest point [m], 0 or above.
    angle : float
        Of the grooves to the axis of the knurled part, v [rad]: 0.2 to 1.37; 30 degrees is common.
    flat : float
        Share of a pitch that the pyramids' flat tops take, 0 to 0.8.
    fillet : float, optional
        Length over which creases are rounded [m], 2 samples or more; a sixteenth of the pitch if
        not given.
    periods, samples : int
        Pyramids in a row along each side of the tile, 1 or more; samples in a pitch, 8 or more.
    """
    require_positive("pitch", pitch, "[m]")
    require_not_negative("height", height, "[m]")
    require_between("angle", angle, 0.2, 1.37, "[rad]")
    require_between("flat", flat, 0.0, 0.8)
    for name, value, least in (("periods", periods, 1), ("samples", samples, FEWEST)):
        require_whole(name, value, least)
    fillet = checked_fillet(fillet, pitch, samples)
    # A tile of the diamond's own proportions holds whole numbers of both sets of grooves.
    sides = periods * pitch / math.cos(angle), periods * pitch / math.sin(angle)
    (u, v), pixel_size = tile(sides, pitch / samples)
    top = max(0.5 * flat, 1e-6)
    corners = [(0.0, 0.0), (0.5 - top, 1.0), (0.5 + top, 1.0)]
    x, y = periods * u / sides[0], periods * v / sides[1]
    ridges = [rounded(x + sign * y, corners, fillet / pitch) for sign in (1.0, -1.0)]
    heights = smoothed(np.minimum(*ridges), pixel_size, fillet)
    return HeightField(_scaled(heights, height), pixel_size, "wrap")


def brushed(
    *,
    size: float,
    pixel_size: float,
    rms: float,
    length: float,
    width: float,
    spread: float = 0.02,
    coverage: float = 6.0,
    seed: int = 0,
) -> HeightField:
    """Return brushed metal: fine scratches along u, of random place, length, width and depth.

    Parameters
    ----------
    size : float
        Side of the tile [m], rounded to whole pixels, 16 or more.
    pixel_size : float
        Distance between samples [m], above 0.
    rms : float
        Root mean square height [m], 0 or above.
    length : float
        Of a scratch on average [m], `width` to half the size.
    width : float
        Of a scratch on average [m], 6 pixels to a sixteenth of the size.
    spread : float
        Standard deviation of the scratches' directions [rad], 0 to 0.3.
    coverage : float
        Mean number of scratches over a point, 0.1 to 100.
    seed : int
        0 or above.
    """
    require_positive("size", size, "[m]")
    require_positive("pixel_size", pixel_size, "[m]")
    require_not_negative("rms", rms, "[m]")
    require_between("width", width, 6.0 * pixel_size * (1.0 - 1e-9), size / 16.0, "[m]")
    require_between("length", length, width, 0.5 * size, "[m]")
    require_between("spread", spread, 0.0, 0.3, "[rad]")
    require_between("coverage", coverage, 0.1, 100.0)
    count = max(1, round(coverage * size * size / (length * width)))
    if count > MOST_SCRATCHES:
        raise AsperityError(
            f"{count} scratches are too many; valid: {MOST_SCRATCHES} at most, by a smaller size "
            "or coverage, or longer or wider scratches"
        )
    side = max(16, round(size / pixel_size)) * pixel_size
    (u, v), pixels = tile((side, side), pixel_size)
    rng = _generator(seed)
    places = rng.uniform(0.0, side, (count, 2))
    lengths = length * rng.uniform(0.5, 1.5, count)
    # Clipped, so that none is narrower than 4 samples.
    widths = width * np.clip(rng.lognormal(0.0, 0.3, count), 2.0 / 3.0, 2.0)
    angles = spread * np.clip(rng.standard_normal(count), -3.0, 3.0)
    depths = widths / width * rng.uniform(0.2, 1.0, count)
    heights = np.zeros((v.size, u.size))
    for place, long, wide, angle, depth in zip(
        places, lengths, widths, angles, depths, strict=True
    ):
        cosine, sine = math.cos(angle), math.sin(angle)
        reach = 0.5 * (long * cosine + wide), 0.5 * (long * abs(sine) + 2.0 * wide)
        (columns, x), (rows, y) = _window((place[0], place[1]), reach, pixels)
        along = x[None, :] * cosine + y[:, None] * sine
        across = y[:, None] * cosine - x[None, :] * sine
        groove = _bump(2.0 * along / long) * _bump(across / wide)
        heights[np.ix_(rows % v.size, columns % u.size)] -= depth * groove
    heights -= heights.mean()
    spread_out = float(heights.std())
    return HeightField(heights * (rms / spread_out), pixels, "wrap")


def _smooth_noise(
    shape: tuple[int, ...],
    pixel_size: tuple[float, float],
    length: float,
    random: np.random.Generator,
) -> Array:
    """Return periodic noise of mean 0 and standard deviation 1, smooth over `length` [m]."""
    waves = np.hypot(
        np.fft.fftfreq(shape[0], pixel_size[1])[:, None], np.fft.rfftfreq(shape[1], pixel_size[0])
    )
    noise = np.fft.rfft2(random.standard_normal(shape))
    noise *= np.exp(-2.0 * (math.pi * length * waves) ** 2)
    out = np.fft.irfft2(noise, s=shape)
    return (out - out.mean()) / out.std()


def _bump(x: Array) -> Array:
    """Return a smooth bump, 1 at 0 and 0 from -1 and 1 on, with two continuous derivatives."""
    return np.maximum(1.0 - x * x, 0.0) ** 3


def _window(
    middle: tuple[float, float], reach: tuple[float, float], pixel_size: tuple[float, float]
) -> list[tuple[Indices, Array]]:
    """Return, along u and v, the indices of samples within `reach` and their offsets [m]."""
    axes = []
    for at, far, pixel in zip(middle, reach, pixel_size, strict=True):
        first, end = math.floor((at - far) / pixel), math.ceil((at + far) / pixel)
        indices: Indices = np.arange(first, end, dtype=np.int64)
        axes.append((indices, (indices.astype(np.float64) + 0.5) * pixel - at))
    return axes


def _scaled(heights: Array, height: float) -> Array:
    """Return `heights` scaled to 0 to `height` [m]."""
    low, high = float(heights.min()), float(heights.max())
    return (heights - low) * (height / (high - low))


def _generator(seed: int) -> np.random.Generator:
    return np.random.default_rng(require_whole("seed", seed, 0))
