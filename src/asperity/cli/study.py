"""`asperity study`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional

from asperity.cli.ranges import Between, check_ranges
from asperity.errors import require_choice

if TYPE_CHECKING:
    from asperity.studies.otaduy_lin_2004.studies import StudySettings


@dataclass
class HandOptions:
    """The hand of Eq. 7."""

    mass_kg: Annotated[float, Between(1e-3, 10.0)] = 0.05
    """Mass [kg]."""
    stiffness_n_m: Annotated[float, Between(10.0, 1e5)] = 300.0
    """Stiffness [N/m]."""
    damping_n_s_m: Annotated[float, Between(0.01, 100.0)] = 3.0
    """Damping [N s/m]."""


@dataclass
class StudyCommand:
    """Run the paper's studies: diameter, force, speed, models, or all.

    Writes a figure (PNG and SVG), a dataset (netCDF) and claims.json for each.
    """

    name: Annotated[Positional[str], "study"]
    """diameter, force, speed, models, or all"""
    surface: str = "sinusoid"
    """sinusoid, trapezoid, square, dots, self-affine, or a file of heights."""
    metric: str = "max_acceleration"
    """Of the main figure: max_acceleration, max_abs_acceleration, band_rms, threshold_power."""
    spacing_range_mm: Annotated[tuple[float, float], Between(0.05, 20.0)] = (0.5, 3.5)
    """Smallest and largest spacing [mm]."""
    spacings: Annotated[int, Between(5, 1000)] = 40
    """How many, equally far apart in log."""
    diameters_mm: Annotated[tuple[float, ...], Between(0.05, 50.0)] = (2.0, 3.0, 4.0)
    """Of the probe [mm]; the middle one serves the other studies."""
    forces_n: Annotated[tuple[float, ...], Between(1e-3, 100.0)] = (0.29, 0.58, 0.87)
    """Normal force [N]."""
    speeds_mm_s: Annotated[tuple[float, ...], Between(0.1, 1e4)] = (42.0, 83.0, 169.0)
    """Speed [mm/s]."""
    amplitude_mm: Annotated[float, Between(1e-4, 10.0)] = 0.1
    """Of the sinusoid [mm]."""
    element_height_mm: Annotated[float, Between(1e-3, 10.0)] = 0.4
    """Of ridges and dots [mm]."""
    element_width_mm: Annotated[float, Between(1e-3, 20.0)] = 0.5
    """Of a ridge's top, or of a dot's [mm]."""
    flank_mm: Annotated[float, Between(0.0, 20.0)] = 0.05
    """Horizontal width of the sloping sides of ridges and dots [mm]."""
    jitter: Annotated[float, Between(0.0, 1.0)] = 0.5
    """Of the dots, as a part of half the spacing, 0 to 1."""
    hurst: Annotated[float, Between(0.0, 1.0)] = 0.8
    """Hurst exponent of the self-affine surface, 0 to 1."""
    rms_slope: Annotated[float, Between(1e-3, 10.0)] = 0.3
    """Of the self-affine surface."""
    height_range_mm: Annotated[float | None, Between(1e-4, 10.0)] = None
    """Peak to peak of a height map that carries no scale [mm]."""
    missing: str = "refuse"
    """What to do with gaps (NaN) in a height map: refuse, or fill from their surroundings."""
    band_hz: Annotated[tuple[float, float], Between(0.1, 1e4)] = (20.0, 200.0)
    """Of the band metric [Hz]."""
    hand: HandOptions = field(default_factory=HandOptions)
    seed: Annotated[int, Between(0, 2**31 - 1)] = 0
    """Of jitter, roughness and noise."""
    out: Path | None = None
    """Folder for the results. Default: out/study."""
    overwrite: bool = False
    """Replace what is in the folder."""

    def settings(self) -> StudySettings:
        """Return the options in SI units, checked."""
        from asperity.dynamics.dragged_hand.hand import Hand
        from asperity.studies.otaduy_lin_2004.stimuli import StimulusOptions
        from asperity.studies.otaduy_lin_2004.studies import StudySettings

        low, high = self.spacing_range_mm
        stimulus = StimulusOptions(
            amplitude=self.amplitude_mm * 1e-3,
            element_height=self.element_height_mm * 1e-3,
            element_width=self.element_width_mm * 1e-3,
            flank=self.flank_mm * 1e-3,
            jitter=self.jitter,
            hurst=self.hurst,
            rms_slope=self.rms_slope,
            height_range=None if self.height_range_mm is None else self.height_range_mm * 1e-3,
            missing=self.missing,
            seed=self.seed,
        )
        return StudySettings(
            surface=self.surface,
            stimulus=stimulus,
            hand=Hand(self.hand.mass_kg, self.hand.stiffness_n_m, self.hand.damping_n_s_m),
            spacing_range=(low * 1e-3, high * 1e-3),
            spacings=self.spacings,
            diameters=tuple(value * 1e-3 for value in self.diameters_mm),
            forces=self.forces_n,
            speeds=tuple(value * 1e-3 for value in self.speeds_mm_s),
            band=self.band_hz,
        )

    def run(self) -> None:
        """Run, write, and print what holds."""
        check_ranges(self)
        from asperity._core.output import result_folder
        from asperity.cli.progress import compile_notice, progress_bars
        from asperity.runs.vibration_metrics import METRICS
        from asperity.studies.otaduy_lin_2004.studies import STUDIES, run_study
        from asperity.studies.otaduy_lin_2004.write import write_studies

        require_choice("study", self.name, [*STUDIES, "all"])
        require_choice("metric", self.metric, METRICS)
        settings = self.settings()
        make_surface = settings.sweep().make_surface
        for spacing in settings.spacing_range:
            make_surface(spacing).tracer(max(settings.diameters))
        names = STUDIES if self.name == "all" else (self.name,)
        total = settings.spacings * sum(settings.drags(name) for name in names)
        out = self.out or Path("out/study")
        with result_folder(out, overwrite=self.overwrite) as folder:
            sweep = settings.sweep()
            with progress_bars() as bars:
                task = bars.add_task(compile_notice(), total=total)
                results = {
                    name: run_study(
                        name, settings, sweep=sweep, progress=lambda _: bars.advance(task)
                    )
                    for name in names
                }
            claims = write_studies(results, self.metric, folder)
        held = sum(claim["holds"] for claim in claims)
        print(f"{out}: {', '.join(names)}; {held} of {len(claims)} claims hold (see claims.json)")
