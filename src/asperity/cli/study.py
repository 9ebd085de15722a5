"""`asperity study`."""

from __future__ import annotations

from dataclasses import MISSING, Field, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from asperity.cli.options import Range, command, in_si, with_options
from asperity.cli.result import print_result
from asperity.errors import AsperityError, require_choice

if TYPE_CHECKING:
    from asperity.studies.otaduy_lin_2004.studies import StudySettings


@command
@dataclass
class HandOptions:
    """The hand: a mass on a spring and a damper (Otaduy & Lin 2004, Eq. 7)."""

    mass_kg: Annotated[float, Range(1e-3, 10.0, "kg")] = 0.05
    """Mass of the hand."""
    stiffness_n_m: Annotated[float, Range(10.0, 1e5, "N/m")] = 300.0
    """Stiffness of the hand."""
    damping_n_s_m: Annotated[float, Range(0.01, 100.0, "N s/m")] = 3.0
    """Damping of the hand."""


@command
@dataclass
class StudyCommand:
    """Run a perceptual study of Otaduy & Lin (2004): diameter, force, speed, models, or all.

    Writes a figure (PNG and SVG) and a dataset (netCDF) for each study, and claims.json. With
    --ensemble, judges the claims of the three plates over 36 hands and many surfaces instead.
    """

    name: Annotated[Positional[str], arg(metavar="NAME")] = "all"
    """diameter, force, speed, models, or all; with --tool finger modulus, force, speed, or all"""
    tool: str = "probe"
    """What is dragged: probe, the rigid sphere of the paper, or finger, the soft fingertip of the
    scene finger-plate. The paper's claims are not judged for a finger."""
    ensemble: bool = False
    """Judge the claims for 36 hands, five amplitudes and eight plates of dots: ensemble.json,
    ensemble.csv, ensemble.md, members.json and figures. Takes no other option than --out and
    --overwrite."""
    surface: str = "sinusoid"
    """sinusoid, trapezoid, square, dots, self-affine, or a file of heights."""
    metric: str = "max_acceleration"
    """Metric of the main figure: max_acceleration, max_abs_acceleration, band_rms,
    threshold_power."""
    spacing_range_mm: Annotated[tuple[float, float], Range(0.05, 20.0, "mm")] = (0.5, 3.5)
    """Smallest and largest spacing."""
    spacings: Annotated[int | None, Range(5, 1000)] = None
    """Number of spacings, equally spaced in log. Default: 40; 160 with a finger, whose curves have
    many peaks."""
    diameters_mm: Annotated[tuple[float, ...], Range(0.05, 50.0, "mm")] = (2.0, 3.0, 4.0)
    """Probe diameters; the other studies use the middle one."""
    moduli_kpa: Annotated[tuple[float, ...], Range(0.1, 1e6, "kPa")] = (6.0, 12.0, 24.0)
    """Young's moduli of the finger's pad; the other studies of a finger use the middle one."""
    forces_n: Annotated[tuple[float, ...], Range(1e-3, 100.0, "N")] = (0.29, 0.58, 0.87)
    """Normal forces; the other studies use the middle one."""
    speeds_mm_s: Annotated[tuple[float, ...], Range(0.1, 1e4, "mm/s")] = (42.0, 83.0, 169.0)
    """Sliding speeds; the other studies use the middle one."""
    amplitude_mm: Annotated[float, Range(1e-4, 10.0, "mm")] = 0.1
    """Amplitude of the sinusoid: half of peak to peak."""
    element_height_mm: Annotated[float, Range(1e-3, 10.0, "mm")] = 0.4
    """Height of ridges and dots."""
    element_width_mm: Annotated[float, Range(1e-3, 20.0, "mm")] = 0.5
    """Width of the top of a ridge; diameter of the top of a dot."""
    flank_mm: Annotated[float, Range(0.0, 20.0, "mm")] = 0.05
    """Horizontal width of the sloping sides of ridges and dots."""
    jitter: Annotated[float, Range(0.0, 1.0)] = 0.5
    """Largest displacement of a dot, as a fraction of half the spacing."""
    hurst: Annotated[float, Range(0.0, 1.0)] = 0.8
    """Hurst exponent of the self-affine surface."""
    rms_slope: Annotated[float, Range(1e-3, 10.0)] = 0.3
    """RMS slope of the self-affine surface."""
    height_range_mm: Annotated[float | None, Range(1e-4, 10.0, "mm")] = None
    """Peak-to-valley height of a height map that carries no vertical scale, such as an image."""
    missing: str = "refuse"
    """Treatment of gaps (NaN) in a height map: refuse, or fill from the surroundings."""
    band_hz: Annotated[tuple[float, float], Range(0.1, 1e4, "Hz")] = (20.0, 200.0)
    """Band of the metric band_rms."""
    hand: HandOptions = field(default_factory=HandOptions)
    seed: Annotated[int, Range(0, 2**31 - 1)] = 0
    """Seed of jitter, roughness and noise."""
    out: Path | None = None
    """Folder for the results. Default: out/study."""
    overwrite: bool = False
    """Replace files of the same names in the folder."""

    def settings(self) -> StudySettings:
        """Return the settings of the studies, in SI units."""
        from asperity.dynamics.dragged_hand.hand import Hand
        from asperity.studies.otaduy_lin_2004.stimuli import StimulusOptions
        from asperity.studies.otaduy_lin_2004.studies import StudySettings
        from asperity.studies.skin.fingertip import Fingertip

        options = in_si(self)
        hand = with_options(Hand, in_si(self.hand))
        stimulus = with_options(StimulusOptions, options)
        finger = Fingertip() if self.tool == "finger" else None
        options.spacings = options.spacings or (40 if finger is None else 160)
        return with_options(StudySettings, options, stimulus=stimulus, hand=hand, finger=finger)

    def run(self) -> None:
        """Run the studies, write the results, and print how many claims hold."""
        if self.ensemble:
            self._run_ensemble()
            return
        from asperity._core.output import result_folder
        from asperity.cli.progress import progress_bars
        from asperity.runs.vibration_metrics import METRICS
        from asperity.studies.otaduy_lin_2004.claims import count_reproduced
        from asperity.studies.otaduy_lin_2004.studies import require_study, run_study
        from asperity.studies.otaduy_lin_2004.write import NOT_JUDGED, write_studies

        self._require_fitting()
        settings = self.settings()
        require_study(self.name, settings, "all")
        require_choice("metric", self.metric, METRICS)
        names = settings.studies() if self.name == "all" else (self.name,)
        settings.require_surfaces()
        total = settings.spacings * sum(settings.drags(name) for name in names)
        out = self.out or Path("out/study")
        with result_folder(out, overwrite=self.overwrite) as folder:
            simulator = settings.simulator()
            with progress_bars() as bars:
                task = bars.add_task("studies", total=total)
                results = {
                    name: run_study(
                        name,
                        settings,
                        simulator=simulator,
                        peaks=settings.finger is None,
                        progress=lambda _: bars.advance(task),
                    )
                    for name in names
                }
            claims = write_studies(results, self.metric, folder)
        held, counted = count_reproduced(claims)
        verdict = NOT_JUDGED if settings.finger is not None else (
            f"{held} of {counted} claims of the paper reproduce "
            f"(its sinusoid and metric; {len(claims)} verdicts in claims.json)"
        )  # fmt: skip
        print_result(
            f"{out}: {', '.join(names)}; {verdict}",
            {"out": out, "studies": list(names), "claims": claims},
        )

    def _require_fitting(self) -> None:
        """Refuse an unknown tool, and levels of what the tool has not."""
        require_choice("tool", self.tool, ("probe", "finger"))
        name, what = {
            "probe": ("moduli_kpa", "the probe is rigid"),
            "finger": ("diameters_mm", "a finger has no diameter"),
        }[self.tool]
        if name in self._changed():
            raise AsperityError(f"{what}: leave out --{name.replace('_', '-')}, or change --tool")

    def _changed(self) -> list[str]:
        """Return the names of options that are not at their defaults."""
        return [option.name for option in fields(self)
                if getattr(self, option.name) != _default(option)]  # fmt: skip

    def _run_ensemble(self) -> None:
        from asperity._core.output import result_folder
        from asperity.cli.progress import progress_bars
        from asperity.studies.ensemble.members import EnsembleSettings
        from asperity.studies.ensemble.run import run_ensemble
        from asperity.studies.ensemble.write import write_ensemble

        free = ("ensemble", "out", "overwrite")
        changed = [name for name in self._changed() if name not in free]
        if changed:
            raise AsperityError(
                f"--ensemble spans all settings: leave out {', '.join(changed)}, or --ensemble"
            )
        settings = EnsembleSettings()
        total = len(settings.sinusoids()) + len(settings.dots())
        out = self.out or Path("out/ensemble")
        with result_folder(out, overwrite=self.overwrite) as folder:
            with progress_bars() as bars:
                task = bars.add_task("plates", total=total)
                result = run_ensemble(settings, progress=lambda: bars.advance(task))
            summary = write_ensemble(result, folder)
        paper, people = summary["paper"], summary["people"]
        band, own = (people["median_count"][name] for name in ("band_rms", "max_acceleration"))
        print_result(
            f"{out}: median over {paper['members']} members, the paper's analysis: "
            f"{paper['median_count']['max_acceleration']:g} of {paper['counted']} claims; over "
            f"{people['members']} members on jittered dots, people: max u'' {own:g}, RMS of u'' "
            f"in 20-200 Hz {band:g} of {people['counted']} (see ensemble.md)",
            {"out": out} | summary,
        )


def _default(option: Field[Any]) -> object:
    """Return the default of an option."""
    if option.default_factory is not MISSING:
        return option.default_factory()
    return option.default
