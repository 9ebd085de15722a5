"""Drags of a hand over a surface, by spacing, probe, force and speed; each is simulated once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from asperity.dynamics.dragged_hand.hand import Hand, Motion, MotionStatus, drag, shake
from asperity.errors import AsperityError, SurfaceError, require_choice
from asperity.geometry.offsets.piecewise import PiecewiseCubic
from asperity.geometry.offsets.sampled import HeightMap
from asperity.geometry.offsets.surface import Profile
from asperity.runs.vibration_metrics import DEFAULT_BAND, evaluate
from asperity.studies.otaduy_lin_2004.force_models import ho, minsky, otaduy_lin, siira_pai
from asperity.studies.otaduy_lin_2004.stimuli import StimulusOptions, surface_maker
from asperity.studies.skin.fingertip import Fingertip

MODELS = {
    "otaduy-lin": "Otaduy & Lin 2004",
    "minsky": "Minsky 1995",
    "ho": "Ho et al. 1999",
    "siira-pai": "Siira & Pai 1996",
}
_LEAST_SLOPE = 1e-12
"""Largest slope of a texture that counts as flat: an atom's height in a hundred metres."""
_NOISE_SECONDS = 4.0
_NOISE_TICK = 1e-3


def drag_over(
    force: PiecewiseCubic, normal_force: float, hand: Hand, speed: float
) -> Motion | None:
    """Return the motion of a hand dragged against a texture force; None over a flat surface.

    Parameters
    ----------
    force : PiecewiseCubic
        F_u over one period of the surface [N].
    normal_force : float
        [N]
    hand : Hand
    speed : float
        [m/s]
    """
    if not np.max(np.abs(force.coefficients)) > _LEAST_SLOPE * normal_force:
        return None
    return drag(force, hand, speed)


@dataclass(frozen=True)
class Condition:
    """The condition of a drag, in SI units."""

    spacing: float
    diameter: float
    """Of the probe; 0 for a finger."""
    normal_force: float
    speed: float
    modulus: float = 0.0
    """Young's modulus of a finger's pad [Pa]; 0 for a probe."""


@dataclass
class DragSimulator:
    """Simulates drags of one hand over one kind of surface.

    Slope tables and motions are kept, because studies share them.

    Parameters
    ----------
    surface : str
        One of `SURFACES`, or a file of heights.
    options : StimulusOptions
        Shape of the surface.
    hand : Hand
    model : str
        The force model, a key of `MODELS`.
    band : (low, high)
        Band of the metric `band_rms` [Hz].
    finger : Fingertip, optional
        A soft finger in place of the probe, with the modulus of the condition. Its path is
        another for each normal force.
    """

    surface: str = "sinusoid"
    options: StimulusOptions = field(default_factory=StimulusOptions)
    hand: Hand = field(default_factory=Hand)
    model: str = "otaduy-lin"
    band: tuple[float, float] = DEFAULT_BAND
    finger: Fingertip | None = None
    _tables: dict[tuple[float, ...], PiecewiseCubic] = field(default_factory=dict, repr=False)
    _motions: dict[Condition, Motion] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        require_choice("model", self.model, MODELS)
        if self.finger is not None and self.model != "otaduy-lin":
            raise AsperityError(
                f"a finger has one force, that of its energy, got model={self.model!r}; valid: "
                "otaduy-lin"
            )

    @cached_property
    def make_surface(self) -> Callable[[float], Profile]:
        """The function that returns the surface of a spacing [m]."""
        return surface_maker(self.surface, self.options)

    def with_hand(self, hand: Hand, band: tuple[float, float]) -> DragSimulator:
        """Return a simulator of another hand and band with the same surfaces and slope tables."""
        if (hand, band) == (self.hand, self.band):
            return self
        other = replace(self, hand=hand, band=band, _motions={})
        other.__dict__["make_surface"] = self.make_surface
        return other

    def motion(self, condition: Condition) -> Motion:
        """Return the hand's motion under a condition."""
        if self.model == "siira-pai":
            # The model depends on neither spacing nor diameter: all share one motion.
            condition = replace(condition, spacing=1.0, diameter=1.0)
        if condition not in self._motions:
            self._motions[condition] = self._drag(condition)
        return self._motions[condition]

    def metric(self, name: str, condition: Condition) -> float:
        """Return a metric (a key of `METRICS`) of the motion under a condition."""
        return evaluate(name, self.motion(condition), band=self.band)

    def periodic(self, condition: Condition) -> bool:
        """Return whether the motion under a condition repeats with the surface."""
        return self.motion(condition).status == MotionStatus.PERIODIC

    def _drag(self, condition: Condition) -> Motion:
        if self.model == "siira-pai":
            noise = siira_pai.texture_force(
                condition.normal_force, _NOISE_SECONDS, seed=self.options.seed
            )
            return shake(noise, _NOISE_TICK, self.hand, condition.speed)
        motion = drag_over(
            self._force(condition), condition.normal_force, self.hand, condition.speed
        )
        if motion is None:
            tool = f"probe of {condition.diameter * 1e3:g} mm" if self.finger is None else "finger"
            raise SurfaceError(
                f"surface {self.surface!r} is flat for a {tool} "
                f"at spacing {condition.spacing * 1e3:.3g} mm: there is nothing to feel; "
                f"give one with relief along the path of the {tool.split()[0]}"
            )
        if not motion.largest > 0.0:
            raise AsperityError(
                f"the hand stays in a notch under {condition.normal_force:g} N at "
                f"spacing {condition.spacing * 1e3:.3g} mm: there is nothing to feel; "
                "give a smaller force or a stiffer hand"
            )
        return motion

    def _force(self, condition: Condition) -> PiecewiseCubic:
        surface, force = self.make_surface(condition.spacing), condition.normal_force
        if self.model == "minsky":
            return minsky.texture_force(surface, force)
        if self.model == "ho":
            return ho.texture_force(surface, force)
        if self.finger is not None:
            key: tuple[float, ...] = (condition.spacing, condition.modulus, force)
            if key not in self._tables:
                finger = replace(self.finger, modulus=condition.modulus)
                self._tables[key] = finger.slope_table(surface, force)
            return self._tables[key].scaled(force)
        key = (condition.spacing, condition.diameter)
        if key not in self._tables:
            tolerance = 1e-3 if isinstance(surface, HeightMap) else 1e-6
            self._tables[key] = otaduy_lin.slope_table(
                surface, condition.diameter, tolerance=tolerance
            )
        return self._tables[key].scaled(force)
