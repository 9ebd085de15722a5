"""The measured surfaces of the demo, and stand-ins where the files are missing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from asperity._core.arrays import Array
from asperity.geometry.offsets.sampled import HeightMap
from asperity.studies.otaduy_lin_2004 import stand_ins
from asperity.texture.files.reading import read_heights


@dataclass(frozen=True)
class RealSurface:
    """A measured surface, how to read it, and what stands in for it."""

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
    """Samples used of the map, and of its stand-in."""
    stand_in: Callable[[], Array]
    """Makes the heights of the stand-in [m], of the same shape and pixel size."""
    stand_in_note: str
    top_first: bool = False
    """Whether the rows of the file are a picture's, from the top, as letters on it show."""

    def load(self, folder: Path | None) -> tuple[HeightMap, str]:
        """Return the surface, measured if its file is in the folder, and a remark on its origin."""
        path = folder / self.file if folder else None
        if path and path.is_file():
            heights = read_heights(
                path, pixel_size=self.pixel_size, height_range=self.height_range, missing="fill"
            )
            samples = heights.samples[: self.shape[0], : self.shape[1]]
            samples = samples[::-1].copy() if self.top_first else samples
            return HeightMap(samples, self.pixel_size), f"Measured. {self.scale_note}"
        return HeightMap(self.stand_in(), self.pixel_size, "wrap"), (
            f"Stand-in made by code, for want of the measured file: {self.stand_in_note}"
        )


_COIN, _PAPER = (300, 300), (1000, 1500)
_COIN_PIXEL, _PAPER_PIXEL = 63.2e-6, 9e-6


def _sandpaper(grit: str, seed: int) -> RealSurface:
    """Return a sandpaper of a grit."""
    grain = stand_ins.GRAINS[grit]
    relief = f"{stand_ins.RELIEF:g} of a grain's diameter"
    return RealSurface(
        f"sandpaper_{grit.lower()}", f"Sandpaper {grit}", f"sandpaper_{grit}_height16.png",
        _PAPER_PIXEL, stand_ins.RELIEF * grain,
        f"GelSight; the file lost its vertical scale: {relief} ({grain * 1e6:g} µm) was chosen; "
        "9 µm a pixel is inferred. A piece of 13.5 by 9 mm is used.",
        _PAPER,
        lambda: stand_ins.sandpaper(_PAPER, _PAPER_PIXEL, grain=grain, seed=seed),
        f"angular grains of {grain * 1e6:g} µm (FEPA 43-1) in wavy resin, {relief} high.",
    )  # fmt: skip


REAL_SURFACES = (
    RealSurface(
        name="coin",
        title="Coin",
        file="us_dime_gelsight.npz",
        pixel_size=_COIN_PIXEL,
        height_range=None,
        scale_note="US dime, GelSight; both scales are the instrument's: 63.2 µm a pixel.",
        shape=_COIN,
        stand_in=lambda: stand_ins.coin(_COIN, _COIN_PIXEL),
        stand_in_note=(
            "smooth, 17.6 mm wide, with letters raised by 70 µm, a numeral by 110 µm, and a rim."
        ),
        top_first=True,
    ),
    _sandpaper("P40", seed=2),
    _sandpaper("P120", seed=3),
)
