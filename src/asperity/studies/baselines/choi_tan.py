r"""The penalty laws of Choi & Tan on a height field, and a god object on it.

Choi & Tan (2003, 2004) touch a wall with a texture, h = A sin(2 pi x / L) + A over it, with the
point p of a stylus. d is the depth of p below the *textured* surface along the wall's normal n_W,
n_T the unit normal of the texture over p:

    fixed    F = K d n_W
    normal   F = K d n_T.

In which direction the force points is what they compare; the first is no gradient of an energy, nor
is the second but for small d. A *god object* g is instead the place of the textured surface that is
nearest to p in the valley where it was before, with

    F = K (g - p),

the gradient of K |g - p|^2 / 2, and along n_T at g.

They also compare two ways to detect contact. `boundary` "surface" is contact with the relief: d
begins at 0. With "plane" contact begins where p passes the wall at the foot of the relief, where
d is h already: the force begins with a step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_choice
from asperity.scene.scene import Scene
from asperity.studies.baselines.point_methods import PointMethod
from asperity.studies.baselines.point_probe import PointProbe, PointTouch
from asperity.studies.baselines.protocol import NOTHING, MethodWrench, Renderer

Array = NDArray[np.float64]
LAWS = ("fixed", "normal", "god-object")
BOUNDARIES = ("surface", "plane")
_ITERATIONS = 50
_CLOSE = 1e-11
"""Length of a step that ends the search for the god object [m]."""
_STRIDE = 0.125
"""Longest step of that search over the texture's shortest wave: it stays in its valley."""


class ChoiTanRenderer(Renderer):
    """Renders one point against the relief."""

    def __init__(self, scene: Scene, law: str, boundary: str) -> None:
        self.probe = PointProbe(scene, raised=True)
        self._law, self._boundary = law, boundary
        self._strides = {
            body.name: math.inf if body.texture is None
            else _STRIDE * body.texture.shortest_wavelength
            for body in scene.bodies
        }  # fmt: skip
        self.god_object: Array | None = None
        """Where the god object is [m], world axes, (3,); None without contact."""

    def reset(self) -> None:
        """Forget all previous poses."""
        self.probe.reset()
        self.god_object = None

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        touch = self.probe.touch(pose)
        if touch is None:
            self.god_object = None
            return NOTHING
        relief = touch.relief(touch.foot)
        depth, field = touch.depth + relief.height, touch.there.body.texture
        lowest = 0.0 if field is None else field.lowest
        if depth <= 0.0 or (self._boundary == "plane" and touch.depth + lowest <= 0.0):
            self.god_object = None
            return NOTHING
        if self._law == "god-object":
            self.god_object = self._follow(touch)
            pull = self.god_object - touch.point
            return self.probe.wrench(
                pose, touch, touch.stiffness * pull, float(np.linalg.norm(pull))
            )
        direction = touch.normal
        if self._law == "normal":
            direction = direction - relief.gradient @ touch.tangents
            direction = direction / np.linalg.norm(direction)
        return self.probe.wrench(pose, touch, touch.stiffness * depth * direction, depth)

    def _follow(self, touch: PointTouch) -> Array:
        """Return the place of the textured surface nearest to p, from where it was before."""
        foot, low = touch.foot, -touch.depth
        at = np.zeros(2) if self.god_object is None else touch.tangents @ (self.god_object - foot)
        stride = self._strides[touch.there.body.name]
        relief = touch.relief(foot + at @ touch.tangents)
        for _ in range(_ITERATIONS):
            # Half the square of the distance, its gradient and its Hessian.
            over = relief.height - low
            gradient = at + over * relief.gradient
            bend = np.eye(2) + np.outer(relief.gradient, relief.gradient) + over * relief.hessian
            # Newton's step where the distance is convex, else down its gradient.
            step: Array = -gradient
            if bend[0, 0] > 0.0 and np.linalg.det(bend) > 0.0:
                step = np.asarray(-np.linalg.solve(bend, gradient), np.float64)
            length = float(np.linalg.norm(step))
            if length > stride:
                step *= stride / length
            now = at @ at + over * over
            for _ in range(30):
                tried = touch.relief(foot + (at + step) @ touch.tangents)
                if float((at + step) @ (at + step)) + (tried.height - low) ** 2 <= now:
                    break
                step *= 0.5
            at, relief = at + step, tried
            if float(np.linalg.norm(step)) < _CLOSE:
                break
        return np.asarray(foot + at @ touch.tangents + relief.height * touch.normal)


@dataclass(frozen=True)
class ChoiTanMethod(PointMethod):
    """One of the laws of Choi & Tan.

    Parameters
    ----------
    law : {"fixed", "normal", "god-object"}
        Force along the wall's normal, along the texture's, or towards the god object.
    boundary : {"surface", "plane"}
        Where contact begins: at the relief, or at the wall under it.
    """

    law: str
    boundary: str = "surface"

    def __post_init__(self) -> None:
        require_choice("law", self.law, LAWS)
        require_choice("boundary", self.boundary, BOUNDARIES)

    def renderer(self, scene: Scene, dt: float) -> ChoiTanRenderer:
        """Return a renderer of a scene."""
        return ChoiTanRenderer(scene, self.law, self.boundary)


_SOURCE = "Choi & Tan 2003, 2004"
_NOT = "No friction, as theirs, and no device: their instabilities are those of hand and device."
FIXED = ChoiTanMethod(
    "choi-tan-fixed", "Choi & Tan, fixed direction", _SOURCE,
    f"{_NOT} The papers' abstracts could be read, their formulas are quoted from other work.",
    "fixed",
)  # fmt: skip
NORMAL = ChoiTanMethod(
    "choi-tan-normal", "Choi & Tan, texture's normal", _SOURCE,
    f"{_NOT} The papers' abstracts could be read, their formulas are quoted from other work.",
    "normal",
)  # fmt: skip
GOD_OBJECT = ChoiTanMethod(
    "choi-tan-god-object", "Choi & Tan, god object", _SOURCE,
    f"{_NOT} They detect contact by Ho et al.'s god object on polygons; here it follows the "
    "smooth height field.",
    "god-object",
)  # fmt: skip
