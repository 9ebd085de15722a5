"""The measured surfaces of the demo, and generated substitutes where the files are missing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from asperity.geometry.offsets.sampled import HeightMap
from asperity.texture.files.reading import read_heights
from asperity.texture.patterns.random_surfaces import self_affine


@dataclass(frozen=True)
class RealSurface:
    """A measured surface, how to read it, and the statistics of its substitute."""

    name: str
    title: str
    file: str
    """Path below the folder of measured data."""
    pixel_size: float
    """[m]"""
    height_range: float | None
    """Chosen peak-to-peak height [m] if the file has no vertical scale; otherwise None."""
    scale_note: str
    shape: tuple[int, int]
    """Samples used of the map, and of its substitute."""
    hurst: float
    rms_slope: float
    rolloff: float
    """[m]"""
    seed: int

    def load(self, folder: Path | None) -> tuple[HeightMap, str]:
        """Return the surface and a sentence about its origin.

        Without the file, a generated self-affine surface of the same pixel size, roll-off, Hurst
        exponent and rms slope takes its place.
        """
        path = folder / self.file if folder else None
        if path and path.is_file():
            heights = read_heights(
                path, pixel_size=self.pixel_size, height_range=self.height_range, missing="fill"
            )
            samples = heights.samples[: self.shape[0], : self.shape[1]]
            return HeightMap(samples, self.pixel_size), f"Measured. {self.scale_note}"
        samples = self_affine(
            self.shape, self.pixel_size, hurst=self.hurst, rms_slope=self.rms_slope,
            rolloff=self.rolloff, seed=self.seed,
        )  # fmt: skip
        return HeightMap(samples, self.pixel_size, "wrap"), (
            "Generated: the measured file is missing, so a self-affine surface of the same "
            f"rms slope ({self.rms_slope:g}), Hurst exponent ({self.hurst:g}) and roll-off "
            f"({self.rolloff * 1e3:g} mm) takes its place."
        )


def _sandpaper(grit: str, grain: float, rms_slope: float, rolloff: float, seed: int) -> RealSurface:
    """Return a sandpaper P`grit` with grains of a diameter [m]."""
    return RealSurface(
        f"sandpaper_p{grit}", f"Sandpaper P{grit} (GelSight)", f"sandpaper_P{grit}_height16.png",
        9e-6, 0.3 * grain,
        f"The file lost its vertical scale: 0.3 of a grain's diameter ({grain * 1e6:g} µm) was "
        "chosen; 9 µm a pixel is inferred. A piece of 7 by 9 mm is used.",
        (1000, 780), 0.8, rms_slope, rolloff, seed,
    )  # fmt: skip


REAL_SURFACES = (
    RealSurface(
        name="coin",
        title="Coin (US dime, GelSight)",
        file="us_dime_gelsight.npz",
        pixel_size=63.2e-6,
        height_range=None,
        scale_note="Both scales are the instrument's: 63.2 µm a pixel.",
        shape=(300, 300),
        hurst=0.8,
        rms_slope=0.2,
        rolloff=4e-3,
        seed=1,
    ),
    _sandpaper("40", 425e-6, rms_slope=0.1, rolloff=1.5e-3, seed=2),
    _sandpaper("120", 115e-6, rms_slope=0.05, rolloff=0.5e-3, seed=3),
)
