"""The surfaces of the findings by spacing, with one or several paths over each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from asperity.geometry.offsets.analytic import Grating, Sinusoid
from asperity.geometry.offsets.dots import DotPlate
from asperity.geometry.offsets.sampled import HeightMap, SampledProfile
from asperity.geometry.offsets.surface import Profile
from asperity.studies.otaduy_lin_2004.stimuli import StimulusOptions
from asperity.texture.files.reading import read_heights
from asperity.texture.patterns.random_surfaces import self_affine

_OPTIONS = StimulusOptions()


@dataclass(frozen=True)
class Sinusoids:
    """Sinusoids, the seed paper's plates; the spacing is the wavelength."""

    amplitude: float = _OPTIONS.amplitude
    """[m]"""

    def surfaces(self, spacing: float) -> tuple[Profile, ...]:
        """Return the paths over the plate of a spacing [m]."""
        return (Sinusoid(self.amplitude, spacing),)


@dataclass(frozen=True)
class Gratings:
    """Trapezoidal gratings; the spacing is the width of the groove at the top."""

    height: float = _OPTIONS.element_height
    ridge: float = _OPTIONS.element_width
    flank: float = _OPTIONS.flank

    def surfaces(self, spacing: float) -> tuple[Profile, ...]:
        """Return the paths over the plate of a spacing [m]."""
        return (Grating(self.height, spacing, self.ridge, min(self.flank, 0.5 * spacing)),)


@dataclass(frozen=True)
class Dots:
    """Jittered raised dots; the spacing is the mean gap between their edges."""

    height: float = _OPTIONS.element_height
    diameter: float = _OPTIONS.element_width
    flank: float = _OPTIONS.flank
    jitter: float = _OPTIONS.jitter
    seed: int = 0
    rows: int = 8
    columns: int = 12
    lines: int = 3
    """Paths over the plate, evenly spread over the rows and over the gap between two rows."""

    def surfaces(self, spacing: float) -> tuple[DotPlate, ...]:
        """Return the paths over the plate of a spacing [m]."""
        pitch = spacing + self.diameter
        step = self.rows // self.lines
        return tuple(
            DotPlate(
                spacing, self.height, self.diameter, self.flank, self.jitter, self.seed,
                self.rows, self.columns, line=(i * step + i / self.lines) * pitch,
            )
            for i in range(self.lines)
        )  # fmt: skip


@dataclass(frozen=True)
class Grains:
    """Self-affine roughness of equal shape at any size; the spacing is its roll-off wavelength."""

    rms_slope: float = _OPTIONS.rms_slope
    hurst: float = _OPTIONS.hurst
    seed: int = 0
    samples: int = 2048
    pixel_size: float = 6e-6
    """[m]"""

    def surfaces(self, spacing: float) -> tuple[SampledProfile, ...]:
        """Return the paths over the plate of a spacing [m]."""
        heights = self_affine(
            self.samples, self.pixel_size, hurst=self.hurst, rms_slope=self.rms_slope,
            rolloff=spacing, cutoff=spacing / 5.0, seed=self.seed,
        )  # fmt: skip
        return (SampledProfile(heights, self.pixel_size, "wrap", spacing),)


@dataclass(frozen=True)
class Paper:
    """A measured sandpaper whose file lacks the vertical scale: the spacing is its relief [m]."""

    file: Path
    pixel_size: float = 9e-6
    """[m]; inferred, not measured."""
    shape: tuple[int, int] = (1000, 780)
    """Samples of the part that is used."""

    def surfaces(self, spacing: float) -> tuple[HeightMap, ...]:
        """Return the paths over the piece with a relief, peak to peak of the file [m]."""
        heights = read_heights(
            self.file, pixel_size=self.pixel_size, height_range=spacing, missing="fill"
        )
        return (HeightMap(heights.samples[: self.shape[0], : self.shape[1]], self.pixel_size),)


Plate = Sinusoids | Gratings | Dots | Grains | Paper
