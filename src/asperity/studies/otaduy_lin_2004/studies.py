"""The three studies of Otaduy & Lin (2004, section 4.2, colour plates 1-3), and one of models.

Each varies one factor over a range of spacings and holds the others at their middle level: the
probe's diameter, the normal force, the speed. The fourth repeats the study of the diameter with
other force models. A soft finger in place of the probe has no diameter; its modulus is varied.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.dragged_hand.hand import Hand, Motion
from asperity.errors import AsperityError, require_choice, require_positive
from asperity.geometry.offsets.sampled import HeightMap
from asperity.runs.vibration_metrics import DEFAULT_BAND, METRICS
from asperity.studies.otaduy_lin_2004.drags import MODELS, Condition, DragSimulator
from asperity.studies.otaduy_lin_2004.peak_fit import Peak, QuadraticFit, fit_quadratic, refine_peak
from asperity.studies.otaduy_lin_2004.stimuli import StimulusOptions
from asperity.studies.skin.fingertip import Fingertip

if TYPE_CHECKING:
    import xarray as xr

FACTORS = {
    "diameter": ("diameter", "probe diameter", "m"),
    "force": ("normal_force", "normal force", "N"),
    "speed": ("speed", "speed", "m/s"),
}
"""Study -> (name of the factor, its label, its unit)."""
STUDIES = (*FACTORS, "models")
_MODULUS = ("modulus", "modulus of the pad", "Pa")
_PHASES = 2048

ReportProgress = Callable[[str], None]
"""Called once for every drag, with the study's name."""


@dataclass(frozen=True)
class StudySettings:
    """Levels and stimuli of the studies. The paper prints none of them: all are asperity's."""

    surface: str = "sinusoid"
    stimulus: StimulusOptions = field(default_factory=StimulusOptions)
    hand: Hand = field(default_factory=Hand)
    spacing_range: tuple[float, float] = (0.5e-3, 3.5e-3)
    """[m]"""
    spacings: int = 40
    diameters: tuple[float, ...] = (2e-3, 3e-3, 4e-3)
    """[m]"""
    forces: tuple[float, ...] = (0.29, 0.58, 0.87)
    """[N]"""
    speeds: tuple[float, ...] = (0.042, 0.083, 0.169)
    """[m/s]"""
    band: tuple[float, float] = DEFAULT_BAND
    """[Hz]"""
    finger: Fingertip | None = None
    """A soft finger in place of the probe; its modulus is the middle one of `moduli`."""
    moduli: tuple[float, ...] = (6e3, 12e3, 24e3)
    """Young's moduli of a finger's pad [Pa]; people differ by a factor of two or more."""

    def __post_init__(self) -> None:
        low, high = self.spacing_range
        require_positive("spacing", low, "[m]")
        if not high > low:
            raise AsperityError(f"spacing_range must rise, got {low * 1e3:g} to {high * 1e3:g} mm")
        if self.spacings < 5:
            raise AsperityError(f"spacings must be at least 5 for a fit, got {self.spacings}")
        for name, values in self.levels().items():
            if not values:
                raise AsperityError(f"{name} needs at least one value")
            for value in values:
                require_positive(name, value, f"[{self.factors()[name][2]}]")
            if list(values) != sorted(set(values)):
                raise AsperityError(f"levels of {name} must rise, got {list(values)}")
        if not 0.0 < self.band[0] < self.band[1] < np.inf:
            raise AsperityError(
                f"band must rise from above 0 Hz and be finite, "
                f"got {self.band[0]:g} to {self.band[1]:g} Hz"
            )

    def factors(self) -> dict[str, tuple[str, str, str]]:
        """Return what the tool's studies vary, as `FACTORS`."""
        if self.finger is None:
            return FACTORS
        return {"modulus": _MODULUS, "force": FACTORS["force"], "speed": FACTORS["speed"]}

    def studies(self) -> tuple[str, ...]:
        """Return the names of the tool's studies."""
        return STUDIES if self.finger is None else tuple(self.factors())

    def levels(self) -> dict[str, tuple[float, ...]]:
        """Return the levels of each factor, by study."""
        own = {"diameter": self.diameters} if self.finger is None else {"modulus": self.moduli}
        return own | {"force": self.forces, "speed": self.speeds}

    def middle(self) -> dict[str, float]:
        """Return the middle level of each factor, by the factor's name."""
        factors = self.factors()
        return {
            factors[study][0]: values[(len(values) - 1) // 2]
            for study, values in self.levels().items()
        }

    def require_surfaces(self) -> None:
        """Raise `AsperityError` if the tool cannot be dragged over the ends of the range."""
        make = self.simulator().make_surface
        for spacing in self.spacing_range:
            if self.finger is None:
                make(spacing).tracer(max(self.diameters))
            else:
                replace(self.finger, modulus=min(self.moduli)).rest(make(spacing), max(self.forces))

    def spacing_values(self) -> NDArray[np.float64]:
        """Return the spacings [m], equally far apart in log."""
        return np.geomspace(*self.spacing_range, self.spacings)

    def drags(self, study: str) -> int:
        """Return how many drags a study makes at each spacing."""
        if study == "models":
            return len(MODELS) * len(self.diameters)
        return len(self.levels()[study])

    def simulator(self, model: str = "otaduy-lin") -> DragSimulator:
        """Return a new simulator of drags with these settings."""
        return DragSimulator(
            self.surface, self.stimulus, self.hand, model, self.band, self.finger
        )  # fmt: skip

    def sweep(self, model: str = "otaduy-lin") -> DragSimulator:
        """Return a new simulator; the deprecated name of `simulator`."""
        warnings.warn(
            "StudySettings.sweep is deprecated: use StudySettings.simulator",
            DeprecationWarning, stacklevel=2,
        )  # fmt: skip
        return self.simulator(model)


def run_study(
    name: str,
    settings: StudySettings | None = None,
    *,
    simulator: DragSimulator | None = None,
    peaks: bool = True,
    progress: ReportProgress | None = None,
    sweep: DragSimulator | None = None,
) -> xr.Dataset:
    """Run one study and return its measurements.

    Parameters
    ----------
    name : {"diameter", "force", "speed", "models"}
        The factor that varies; "models" varies the diameter, for each force model. For a finger
        "modulus", "force" or "speed".
    settings : StudySettings, optional
        Defaults as in the class.
    simulator : DragSimulator, optional
        Simulator of another study with the same settings, whose motions are reused.
    peaks : bool
        Refine the peak of each curve between the spacings.
    progress : callable, optional
        Called after every drag.
    sweep : DragSimulator, optional
        The deprecated name of `simulator`.

    Returns
    -------
    xarray.Dataset
        Dimensions `level` (coordinate: the factor) and `spacing`; for each metric its values,
        the quadratic's coefficients, R^2 and peak, and the refined peak with its uncertainty;
        `status` of each motion; one repeat of `acceleration` at equal phase. Units in `attrs`.
        The study of models has a leading dimension `model`.
    """
    settings = settings or StudySettings()
    require_study(name, settings)
    if sweep is not None:
        warnings.warn(
            "run_study(sweep=...) is deprecated: use simulator=...",
            DeprecationWarning,
            stacklevel=2,
        )
        simulator = sweep
    if name != "models":
        return _run_factor(name, settings, simulator or settings.simulator(), peaks, progress, name)
    import xarray as xr  # slow to import

    parts = []
    for model in MODELS:
        own = simulator if simulator and simulator.model == model else settings.simulator(model)
        parts.append(_run_factor("diameter", settings, own, peaks, progress, name))
    dataset = xr.concat(parts, dim="model", join="outer").assign_coords(model=list(MODELS))
    dataset.attrs = parts[0].attrs | {"study": "models"}
    return dataset


def require_study(name: str, settings: StudySettings, *more: str) -> None:
    """Raise `AsperityError` unless a name is that of a study of the tool, or one of `more`."""
    studies = (*settings.studies(), *more)
    others = {*STUDIES, _MODULUS[0]} - {*studies}
    if name in others:
        tool = "a probe" if settings.finger is None else "a finger"
        raise AsperityError(f"{tool} has no study {name!r}; valid: {', '.join(studies)}")
    require_choice("study", name, studies)


def _run_factor(
    study: str,
    settings: StudySettings,
    simulator: DragSimulator,
    peaks: bool,
    progress: ReportProgress | None,
    name: str,
) -> xr.Dataset:
    import xarray as xr  # slow to import

    factor, label, unit = settings.factors()[study]
    levels, spacing = settings.levels()[study], settings.spacing_values()
    motions: list[list[Motion]] = []
    values: dict[str, list[list[float]]] = {metric: [] for metric in METRICS}
    found: dict[str, list[Peak]] = {metric: [] for metric in METRICS}
    for level in levels:
        fixed = {"diameter": 0.0} | settings.middle() | {factor: level}
        conditions = [Condition(spacing=float(s), **fixed) for s in spacing]
        motions.append([])
        for condition in conditions:
            motions[-1].append(simulator.motion(condition))
            if progress:
                progress(name)
        for metric in METRICS:
            values[metric].append([simulator.metric(metric, c) for c in conditions])
        for metric in METRICS:
            found[metric].append(
                _peak(simulator, metric, fixed, spacing, np.array(values[metric][-1]), peaks)
            )

    def of_motions(get: Callable[[Motion], Any]) -> NDArray[Any]:
        return np.array([[get(motion) for motion in row] for row in motions])

    dims = ("level", "spacing")
    both: dict[str, Any] = {}
    for metric, about in METRICS.items():
        attrs = {"units": about.unit, "long_name": about.label, "origin": about.origin}
        both[metric] = (dims, np.array(values[metric]), attrs)
        fits = [fit_quadratic(spacing, np.array(row)) for row in values[metric]]
        both |= _fit_variables(metric, fits, found[metric])
    both["status"] = (
        dims, of_motions(lambda motion: int(motion.status)),
        {"long_name": "0 periodic, 1 subharmonic, 2 does not repeat", "units": "1"},
    )  # fmt: skip
    both["record_length"] = (dims, of_motions(lambda motion: motion.duration), {"units": "s"})
    both["acceleration"] = (
        (*dims, "phase"),
        of_motions(lambda motion: _wave(motion.acceleration)).astype(np.float32),
        {"units": "m/s²", "long_name": "u'' over the record, at equal phase"},
    )
    coords = {
        "spacing": ("spacing", spacing, {"units": "m", "long_name": "texture spacing"}),
        factor: ("level", np.array(levels), {"units": unit, "long_name": label}),
        "phase": ("phase", np.arange(_PHASES) / _PHASES, {"units": "1"}),
    }
    return xr.Dataset(both, coords, _attributes(study, factor, settings))


def _wave(acceleration: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the record at a fixed number of equally spaced phases."""
    n = acceleration.size
    phase = np.arange(_PHASES) * n / _PHASES
    return np.interp(phase, np.arange(n + 1), np.append(acceleration, acceleration[0]))


def _peak(
    simulator: DragSimulator, metric: str, fixed: dict[str, float],
    spacing: NDArray[np.float64], values: NDArray[np.float64], refine: bool,
) -> Peak:  # fmt: skip
    """Return the peak of a metric at one level of the factor."""
    # A trace over a height map takes a thousand times as long as one over a shape.
    is_map = isinstance(simulator.make_surface(float(spacing[0])), HeightMap)
    return refine_peak(
        lambda place: simulator.metric(metric, Condition(spacing=place, **fixed)),
        spacing, values, rounds=0 if not refine else 1 if is_map else 5,
    )  # fmt: skip


def _fit_variables(name: str, fits: list[QuadraticFit], found: list[Peak]) -> dict[str, Any]:
    """Return the dataset's variables for one metric's fits and peaks."""
    metres = {"units": "m"}
    columns: dict[str, tuple[list[Any], dict[str, str]]] = {
        "fit_r_squared": ([fit.r_squared for fit in fits], {}),
        "fit_peak": ([fit.peak_spacing for fit in fits], metres),
        "fit_peak_error": ([fit.peak_error for fit in fits], metres),
        "peak": ([peak.spacing for peak in found], metres),
        "peak_value": ([peak.value for peak in found], {}),
        "peak_uncertainty": ([peak.uncertainty for peak in found], metres),
        "peak_inside": ([int(peak.inside) for peak in found], {}),
    }
    coefficients = np.array([fit.coefficients for fit in fits])
    return {f"{name}_fit": (("level", "power"), coefficients)} | {
        f"{name}_{what}": (("level",), np.array(column), attrs)
        for what, (column, attrs) in columns.items()
    }


def _attributes(study: str, factor: str, settings: StudySettings) -> dict[str, object]:
    """Return the settings needed to repeat the study."""
    stimulus, hand = settings.stimulus, settings.hand
    held = {f"held_{key}": value for key, value in settings.middle().items() if key != factor}
    if settings.finger is not None:
        pad = asdict(settings.finger)
        held |= {f"finger_{key}": value for key, value in pad.items() if key != "modulus"}
    return {
        "schema": 1,
        "study": study,
        "factor": factor,
        "tool": "probe" if settings.finger is None else "finger",
        # The name of a file need not be valid UTF-8.
        "surface": os.fsencode(settings.surface).decode("utf-8", "replace"),
        "amplitude": stimulus.amplitude,
        "element_height": stimulus.element_height,
        "element_width": stimulus.element_width,
        "flank": stimulus.flank,
        "seed": stimulus.seed,
        "hand_mass": hand.mass,
        "hand_stiffness": hand.stiffness,
        "hand_damping": hand.damping,
        "band": list(settings.band),
        "source": "Otaduy & Lin (2004), section 4.2; all values are asperity's, see the docs",
    } | held
