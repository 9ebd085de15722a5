r"""The methods of one point: Minsky, Ho et al., and Siira & Pai, each with its own contact.

`point_probe` finds the point p, its depth d below the *smooth* surface, that surface's normal n and
the contact's stiffness k. h is the texture's height and grad h its slope at the foot of p.

*Minsky* (1995), Sandpaper. A planar device pulls sideways, down the slope:

    F_lateral = -K grad h - b v.

She has no normal force; here it is that of the smooth contact, k d n, and has no part in the
lateral force. K is a force [N] per unit slope.

*Ho, Basdogan & Srinivasan* (1999). A god object, their ideal haptic interface point (IHIP), follows
p along the smooth surface. The force is a spring from p to it, whose part along n is perturbed:

    M = (n - grad h) / |n - grad h|
    F_n = k ((d - K h) n + K h M)  if d >= K h,  else  k d M
    F_t = k t,   t from the foot of p to the IHIP, |t| <= mu d.

h counts from the lowest point of the map. The IHIP sticks while its spring pulls with less than
Coulomb's friction and else trails by mu d, so that sliding friction is mu k d.

*Siira & Pai* (1996). Hard contact with Coulomb friction, and while p slides a texture force with
normally distributed parts along n and along the direction s of sliding, drawn anew each tick:

    F = max(k d + sigma e_1, 0) n + k t + sigma e_2 s,    e_1, e_2 ~ N(0, 1),   sigma = r k d.

The docs' pages on the methods tell which of this was read where.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import Body
from asperity.scene.scene import Scene
from asperity.studies.baselines.point_probe import PointProbe, PointTouch, point_reason
from asperity.studies.baselines.protocol import NOTHING, Method, MethodWrench, Renderer

Array = NDArray[np.float64]
_STILL = 1e-12
"""Displacement in one tick up to which p is at rest [m]."""


class IdealPoint:
    """Ho's ideal haptic interface point on the smooth surface, or a point held by friction."""

    def __init__(self) -> None:
        self.place: Array | None = None
        """Where it is [m], world axes, (3,); None without contact."""

    def lag(self, touch: PointTouch) -> Array:
        """Move it after p; return the vector (3,) from the foot of p to it [m], at most mu d."""
        if touch.depth <= 0.0:
            self.place = None
            return np.zeros(3)
        lag = np.zeros(3) if self.place is None else touch.across(self.place - touch.foot)
        length, most = float(np.linalg.norm(lag)), touch.friction * touch.depth
        if length > most:
            lag *= most / length
        self.place = touch.foot + lag
        return lag


class PointRenderer(Renderer):
    """Renders one point on the smooth surface; a subclass has the force.

    Parameters
    ----------
    scene : Scene
    dt : float
        Tick [s].
    """

    def __init__(self, scene: Scene, dt: float) -> None:
        self.probe = PointProbe(scene, raised=False)
        self._dt = dt
        self.reset()

    def reset(self) -> None:
        """Forget all previous poses."""
        self.probe.reset()
        self.ideal = IdealPoint()
        self._last: PointTouch | None = None

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        touch = self.probe.touch(pose)
        if touch is None or touch.depth <= 0.0:
            self.ideal.place = self._last = None
            return NOTHING
        if self._last is not None and self._last.there.body is not touch.there.body:
            self.ideal.place = self._last = None
        moved = np.zeros(3)
        if self._last is not None:
            moved = touch.across(touch.point - self._last.point)
        self._last = touch
        return self.probe.wrench(pose, touch, self.force(touch, moved), touch.depth)

    @abstractmethod
    def force(self, touch: PointTouch, moved: Array) -> Array:
        """Return the force (3,) [N], p having `moved` (3,) [m] along the surface in this tick."""


class MinskyRenderer(PointRenderer):
    """Minsky's lateral force, and the smooth contact."""

    def __init__(self, scene: Scene, dt: float, gain: float, damping: float) -> None:
        super().__init__(scene, dt)
        self._gain, self._damping = gain, damping

    def force(self, touch: PointTouch, moved: Array) -> Array:
        """Return the force (3,) [N]."""
        slope = touch.relief(touch.foot).gradient @ touch.tangents
        push = touch.stiffness * touch.depth * touch.normal
        return np.asarray(push - self._gain * slope - self._damping * moved / self._dt)


class HoRenderer(PointRenderer):
    """The perturbed force of Ho et al. between p and the ideal point."""

    def __init__(self, scene: Scene, dt: float) -> None:
        super().__init__(scene, dt)
        self._gain = scene.force.ho_gain

    def force(self, touch: PointTouch, moved: Array) -> Array:
        """Return the force (3,) [N]."""
        lag, field = self.ideal.lag(touch), touch.there.body.texture
        relief = touch.relief(touch.foot)
        perturbed = touch.normal - relief.gradient @ touch.tangents
        perturbed /= np.linalg.norm(perturbed)
        height = 0.0 if field is None else self._gain * (relief.height - field.lowest)
        if touch.depth >= height:
            along = (touch.depth - height) * touch.normal + height * perturbed
        else:
            along = touch.depth * perturbed
        return np.asarray(touch.stiffness * (along + lag))


class SiiraPaiRenderer(PointRenderer):
    """Hard contact, friction and random forces while p slides."""

    def __init__(self, scene: Scene, dt: float, roughness: float | None, seed: int) -> None:
        self._roughness, self.seed = roughness, seed
        bodies = scene.bodies if roughness is None else ()
        self._slopes = {body.name: rms_slope(body) for body in bodies}
        super().__init__(scene, dt)

    def reset(self) -> None:
        """Forget all previous poses, and begin with the same random numbers."""
        super().reset()
        self._random = np.random.default_rng(self.seed)

    def force(self, touch: PointTouch, moved: Array) -> Array:
        """Return the force (3,) [N]."""
        push, pull = touch.stiffness * touch.depth, touch.stiffness * self.ideal.lag(touch)
        length = float(np.linalg.norm(moved))
        if length <= _STILL:
            return np.asarray(push * touch.normal + pull)
        rough = self._roughness
        if rough is None:
            rough = self._slopes[touch.there.body.name]
        along, across = rough * push * self._random.standard_normal(2)
        return np.asarray(max(push + along, 0.0) * touch.normal + pull + across * moved / length)


def rms_slope(body: Body) -> float:
    """Return the RMS slope of a body's texture between its samples [-]; 0 without a texture."""
    field = body.texture
    if field is None or field.relief == 0.0:
        return 0.0
    variance = 0.0
    for axis, pixel in enumerate(field.pixel_size[::-1]):
        variance += float(np.mean((np.diff(field.samples, axis=axis) / pixel) ** 2))
    return math.sqrt(variance)


@dataclass(frozen=True)
class PointMethod(Method):
    """A method of one point on simple solids."""

    def can(self, scene: Scene) -> str | None:
        """Return why the method cannot render a scene, or None."""
        return point_reason(scene)


@dataclass(frozen=True)
class MinskyMethod(PointMethod):
    """Minsky's lateral force.

    Parameters
    ----------
    gain : float
        K, the lateral force on a slope of 1 [N].
    damping : float
        b of the lateral motion [N s/m].
    """

    name: str = "minsky"
    label: str = "Minsky"
    source: str = "Minsky 1995"
    what_it_is_not: str = (
        "Her device moves in a plane and has no normal force; here it is that of the smooth "
        "contact, which the lateral force does not depend on. Her gain could not be read: it is "
        "0.58 N for a slope of 1."
    )
    gain: float = 0.58
    damping: float = 0.0

    def renderer(self, scene: Scene, dt: float) -> MinskyRenderer:
        """Return a renderer of a scene."""
        return MinskyRenderer(scene, dt, self.gain, self.damping)


@dataclass(frozen=True)
class HoMethod(PointMethod):
    """The perturbed normal of Ho et al., with their god object."""

    name: str = "ho"
    label: str = "Ho et al."
    source: str = "Ho, Basdogan & Srinivasan 1999"
    what_it_is_not: str = (
        "One coefficient of friction instead of a static and a dynamic one. The paper itself was "
        "not available; the formula was read in an implementation made from it."
    )

    def renderer(self, scene: Scene, dt: float) -> HoRenderer:
        """Return a renderer of a scene, with its friction and its gain K (`ho_gain`)."""
        return HoRenderer(scene, dt)


@dataclass(frozen=True)
class SiiraPaiMethod(PointMethod):
    """Normally distributed forces while sliding.

    Parameters
    ----------
    roughness : float, optional
        r, standard deviation of the texture force over the normal force [-]; by default the RMS
        slope of the touched body's texture.
    """

    name: str = "siira-pai"
    label: str = "Siira & Pai"
    source: str = "Siira & Pai 1996"
    what_it_is_not: str = (
        "Only the paper's abstract was available. The deviation is the RMS slope of the map times "
        "the normal force, not fitted to a measured surface."
    )
    roughness: float | None = None

    def renderer(self, scene: Scene, dt: float) -> SiiraPaiRenderer:
        """Return a renderer of a scene, with its friction and its seed."""
        return SiiraPaiRenderer(scene, dt, self.roughness, scene.force.seed)


MINSKY, HO, SIIRA_PAI = MinskyMethod(), HoMethod(), SiiraPaiMethod()
