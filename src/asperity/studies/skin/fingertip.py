r"""A soft, ridged fingertip that is dragged over a surface: its texture force, by energy.

The pad is an ellipsoid with an elastic layer, that of the scene `finger-plate`, as a bed of
upright springs. With its lowest point at the height g and its middle over u, a place (x, y) of it
is pressed in by

    delta = h(u + x, y) - g - s(x, y) ,

h being the surface and s how far the pad, with its ridges, is above its lowest point. Its energy is
U(g, u), the integral of the layer's w(delta), and the force on it the integral of the pressure
p = w' (`contact.soft.layer`). Under a constant normal force F_n the finger rests where that force
is F_n, and the energy of finger and load is U + F_n g. So along the surface the finger moves on

    H(u) = g(u) + U(g(u), u) / F_n ,    F_u = F_n dH/du = integral of p dh/du ,

the last because g is where U + F_n g is least. H takes the place of the offset surface in Eq. 6 of
Otaduy & Lin (2004): as the layer gets hard U vanishes, g becomes the offset, and so does H. (g
alone would not do: its slope times F_n is not the force.)

Where relief is low, a pad with an even pressure over a disk of radius a, falling as a paraboloid,
passes a wave of wavenumber k on by `8 J2(k a) / (k a)^2` of its amplitude: fine gratings are
averaged away. What ridges of the same spacing pick up is added to that.

Limits, beside those of the layer: springs stand upright, those of the scene along the normals of
the pad. The phalanx does not tilt. There is no friction; Coulomb's would add a constant to F_u.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity._core.kernels import kernel
from asperity.contact.soft.layer import layer_pressure
from asperity.contact.soft.skin import foundation_modulus
from asperity.errors import AsperityError, require_not_negative, require_positive
from asperity.geometry.offsets.dots import DotPlate
from asperity.geometry.offsets.piecewise import PiecewiseCubic
from asperity.geometry.offsets.sampled import HeightMap, SampledProfile
from asperity.geometry.offsets.surface import Profile
from asperity.scene.builtin.finger_plate import PAD, RIDGES, SKIN
from asperity.studies.otaduy_lin_2004.force_models import minsky

_LEAST_SAMPLES = 64
"""Of a period."""
_AVERAGED = 4
"""Heights whose mean is that of a pixel."""
_RIM = 0.98
"""Part of the pad's semi-axes on which there are springs."""
_ROUNDS = 100
_EXACT = 1e-11
"""Of the normal force."""


class Bed(NamedTuple):
    """The springs of a pad, lines across the path and columns along it."""

    clearance: Array
    """How far each is above the lowest point [m], inf beyond the rim; (lines, columns)."""
    area: float
    """[m^2]"""
    modulus: float
    """Pressure over compression [Pa/m]."""
    thickness: float
    """[m]"""


class FingerRest(NamedTuple):
    """A finger at rest at places of its path; arrays (n,)."""

    height: Array
    """g, of its lowest point [m]."""
    energy: Array
    """U [J]."""
    deepest: Array
    """Largest compression [m]."""


@kernel
def _settle(heights: Array, bed: Bed, force: float, rest_out: FingerRest) -> None:
    """Fill where a bed rests under a force [N], place by place.

    `heights` (lines or 1, places + columns - 1): of the surface below the columns at the first
    place, then on. The force falls with g and is convex in it: Newton's steps end on one side.
    """
    lines, columns = bed.clearance.shape
    top = -math.inf
    for j in range(heights.shape[1]):
        for line in range(heights.shape[0]):
            top = max(top, heights[line, j])
    g = top - 0.1 * bed.thickness
    for i in range(rest_out.height.size):
        load = slope = energy = deepest = 0.0
        for _ in range(_ROUNDS):
            load = slope = energy = deepest = 0.0
            for line in range(lines):
                row = line if heights.shape[0] > 1 else 0
                for j in range(columns):
                    delta = heights[row, i + j] - g - bed.clearance[line, j]
                    if delta > 0.0:
                        p, k, w = layer_pressure(bed.modulus, bed.thickness, delta)
                        load += p
                        slope += k
                        energy += w
                        deepest = max(deepest, delta)
            excess = load * bed.area - force
            if abs(excess) <= _EXACT * force:
                break
            # From above the surface: down by little, so that the next step is not a leap.
            step = excess / (slope * bed.area) if slope > 0.0 else -0.1 * bed.thickness
            g += max(step, -0.25 * bed.thickness)
        rest_out.height[i], rest_out.energy[i] = g, energy * bed.area
        rest_out.deepest[i] = deepest


@dataclass(frozen=True)
class Fingertip:
    """A soft fingertip; by default that of the scene `finger-plate`, which see for its values."""

    semi_axes: tuple[float, float, float] = PAD
    """Of the pad: along the path, across it, upright [m]."""
    thickness: float = SKIN["thickness"]
    """Of the layer [m]."""
    modulus: float = SKIN["modulus"]
    """Young's modulus [Pa]."""
    poisson: float = SKIN["poisson"]
    ridge_spacing: float = RIDGES["wavelength"]
    """Of the ridges along the path [m]."""
    ridge_amplitude: float = RIDGES["amplitude"]
    """Half of their height [m]; 0 without ridges."""
    pixel: float = 20e-6
    """Largest distance of springs along the path [m]."""
    line: float = 0.25e-3
    """Distance of springs across it [m]."""

    def __post_init__(self) -> None:
        for value in self.semi_axes:
            require_positive("semi_axes", value, "[m]")
        foundation_modulus(self.modulus, self.poisson, self.thickness)
        require_positive("ridge_spacing", self.ridge_spacing, "[m]")
        require_not_negative("ridge_amplitude", self.ridge_amplitude, "[m]")
        require_positive("pixel", self.pixel, "[m]")
        require_positive("line", self.line, "[m]")

    def path(self, surface: Profile, force: float) -> SampledProfile:
        """Return the path H along which the finger moves under a normal force [N].

        Raises
        ------
        AsperityError
            The surface is a map of heights, the layer would be pressed flat, or the contact
            would reach the rim of the pad.
        """
        rest, pixel = self.rest(surface, force)
        return SampledProfile(rest.height + rest.energy / force, pixel, "wrap", surface.spacing)

    def slope_table(self, surface: Profile, force: float) -> PiecewiseCubic:
        """Return dH/du over one period of a surface: the texture force over the normal force."""
        return minsky.texture_force(self.path(surface, force), 1.0)

    def rest(self, surface: Profile, force: float) -> tuple[FingerRest, float]:
        """Return how the finger rests along one period, and the distance of its places [m].

        The first place is half of that distance from the start. Raises as `path` does.
        """
        require_positive("force", force, "[N]")
        if isinstance(surface, HeightMap):
            raise AsperityError(
                "a finger touches a width of a surface, of which this map is too little; valid: "
                "dots, or a surface that is the same across the path, such as a file of one line"
            )
        samples = max(math.ceil(surface.period / self.pixel), _LEAST_SAMPLES)
        pixel = surface.period / samples
        across = self._across(isinstance(surface, DotPlate))
        bed = self._bed(pixel, across)
        columns = bed.clearance.shape[1]
        heights = self._heights(surface, samples, across)
        at = np.arange(samples + columns - 1) - columns // 2
        rest = FingerRest(*(np.empty(samples) for _ in FingerRest._fields))
        _settle(np.ascontiguousarray(heights[:, at % samples]), bed, force, rest)
        if rest.deepest.max() > self.thickness:
            raise AsperityError(
                f"{force:g} N presses the layer of the finger flat, which is "
                f"{self.thickness * 1e3:g} mm thick and has a modulus of {self.modulus:g} Pa; "
                "valid: a smaller force, or a larger modulus"
            )
        if heights.max() - rest.height.min() > self._rim():
            raise AsperityError(
                f"under {force:g} N the contact reaches the rim of the finger's pad; valid: a "
                "smaller force, lower relief, a larger modulus"
            )
        return rest, pixel

    def _rim(self) -> float:
        """Return how far the rim of the pad is above its lowest point [m]."""
        return self.semi_axes[2] * (1.0 - math.sqrt(1.0 - _RIM**2))

    def _across(self, differs: bool) -> Array:
        """Return the lines of springs [m]; for a surface that is the same there, of one half."""
        count = math.ceil(self.semi_axes[1] / self.line)
        half = np.arange(0.5, count, dtype=np.float64) * self.line
        return np.concatenate([-half[::-1], half]) if differs else half

    def _bed(self, pixel: float, across: Array) -> Bed:
        a, b, c = self.semi_axes
        reach = math.ceil(a / pixel)
        along = np.arange(-reach, reach + 1) * pixel
        away = (along[None, :] / a) ** 2 + (across[:, None] / b) ** 2
        clearance = c * (1.0 - np.sqrt(np.maximum(1.0 - away, 0.0)))
        # Crests are the lowest: as of a smooth pad, the lowest point is at g.
        clearance += self.ridge_amplitude * (1.0 - np.cos(2.0 * np.pi * along / self.ridge_spacing))
        clearance[away > _RIM**2] = np.inf
        area = pixel * self.line * (2.0 if across[0] > 0.0 else 1.0)
        return Bed(
            clearance, area, foundation_modulus(self.modulus, self.poisson, self.thickness),
            self.thickness,
        )  # fmt: skip

    def _heights(self, surface: Profile, samples: int, across: Array) -> Array:
        """Return mean heights of the pixels of a period [m], (lines or 1, samples)."""
        places = (np.arange(samples * _AVERAGED) + 0.5) * (surface.period / samples / _AVERAGED)
        if isinstance(surface, DotPlate):
            middle = 0.5 * surface.pitch if surface.line is None else surface.line
            fine = surface.heights(places[None, :], middle + across[:, None])
        else:
            fine = surface.heights(places)[None, :]
        means = fine.reshape(-1, samples, _AVERAGED).mean(axis=2)
        return np.asarray(means, dtype=np.float64)
