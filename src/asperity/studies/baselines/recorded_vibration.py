r"""Recorded vibration, played back on a smooth surface depending on force and speed.

Culbertson, Lopez Delgado & Kuchenbecker, *One hundred data-driven haptic texture models and
open-source methods for rendering on 3D objects* (2014). The surface is smooth. The vibration of a
tool on the real surface is modelled by filters over normal force F_n and speed v (see
`vibrotactile.model`), interpolated at the current F_n and v and driven by white noise to an
acceleration a. Then

    F = F_smooth + m a t,   t = n x v / |n x v| ,

where m is the effective mass of hand and device. The vibration is tangential and perpendicular to
the motion, because friction already acts along the motion.

`recorded-harmonic` is asperity's addition: what repeats over distance is not noise but sines over
the travelled distance (`vibrotactile.harmonic`).

The model is given, or fitted by `vibrotactile.fit`, as in `asperity fit`, to slides of the same
tool over a sample of the same texture at a grid of forces and speeds. F_smooth and F_n are those of
the scene's bodies without textures; v is low-passed at 125 rad/s, as in a port of the authors' code
to another device. The direction perpendicular to the motion is quoted from other work.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_positive
from asperity.scene.scene import Scene, scene_of
from asperity.scene.trajectory import ScriptedMotion
from asperity.studies.baselines.asperity_laws import SolverRenderer
from asperity.studies.baselines.placement import (
    centre_at,
    is_level,
    only_one_target,
    place_bodies,
    tool_and_others,
    top_of,
    without_textures,
)
from asperity.studies.baselines.protocol import Method, MethodWrench, Renderer
from asperity.vibrotactile.explore import explore
from asperity.vibrotactile.fit import FitSettings, fit
from asperity.vibrotactile.model import TextureModel
from asperity.vibrotactile.rates import at_rate
from asperity.vibrotactile.synthesis import Synthesiser

Array = NDArray[np.float64]
SPEEDS = (0.03, 0.08, 0.16)
"""Speeds of the slides to which a model is fitted [m/s]."""
FORCES = (0.3, 0.6, 1.2)
"""Normal forces of these slides [N]."""
_SECONDS = 0.8
_LOW_PASS = 125.0
"""Corner frequency of the low-pass filter of the velocity [rad/s]."""


@dataclass(eq=False)
class VibrationRenderer(Renderer):
    """Renders the smooth contact of a scene with a vibration added."""

    smooth: SolverRenderer
    synthesiser: Synthesiser
    """Of a model at the rate of the poses."""
    centre: Array
    """The tool's centre of mass in its frame [m], (3,)."""
    mass: float
    """m [kg]."""
    dt: float
    """Time between poses [s]."""

    def __post_init__(self) -> None:
        self._share = -math.expm1(-_LOW_PASS * self.dt)
        self.reset()

    def reset(self) -> None:
        """Forget all previous poses and restart the noise."""
        self.smooth.reset()
        self.synthesiser.reset()
        self._last: Array | None = None
        self._velocity = np.zeros(3)

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        wrench = self.smooth.wrench(pose)
        moved = np.zeros(3) if self._last is None else (pose[:3] - self._last) / self.dt
        self._velocity += self._share * (moved - self._velocity)
        self._last = np.array(pose[:3])
        normal = float(np.linalg.norm(wrench.force))
        n = wrench.force / normal if normal > 0.0 else np.zeros(3)
        along = self._velocity - (self._velocity @ n) * n
        speed = float(np.linalg.norm(along))
        a = self.synthesiser.next(speed, normal)
        if normal == 0.0 or speed == 0.0:
            return wrench
        force = self.mass * a * np.cross(n, along / speed)
        contacts = self.smooth.solver.contacts
        deepest = int(np.argmax(contacts.depth[: wrench.contacts]))
        arm = contacts.point[deepest] - centre_at(pose, self.centre)
        return wrench._replace(
            force=wrench.force + force, torque=wrench.torque + np.cross(arm, force)
        )


@dataclass(frozen=True)
class VibrationMethod(Method):
    """Recorded vibration over a smooth surface.

    Parameters
    ----------
    kind : {"noise", "harmonic"}
        Of the model that is fitted, see `vibrotactile.fit.FitSettings`.
    model : TextureModel, optional
        By default it is fitted to the scene.
    mass : float
        The effective mass [kg], above 0.
    seed : int
        Seed of the noise.
    """

    name: str = "recorded-vibration"
    label: str = "recorded vibration"
    source: str = "Culbertson, Lopez Delgado & Kuchenbecker 2014"
    what_it_is_not: str = (
        "Fitted to asperity's own forces, not to recordings of a real tool. It repeats a spectrum, "
        "not a surface: nothing is where it was."
    )
    kind: str = "noise"
    model: TextureModel | None = None
    mass: float = 0.05
    seed: int = 0

    def __post_init__(self) -> None:
        require_positive("mass", self.mass, "kg")

    def can(self, scene: Scene) -> str | None:
        """Return why the method cannot render a scene, or None."""
        reason = only_one_target(scene)
        if reason is not None or self.model is not None:
            return reason
        if all(body.texture is None for body in scene.bodies):
            return "nothing is textured, so nothing vibrates"
        if any(body.mesh is not None for body in scene.bodies):
            return "a grid of slides over meshes would take minutes; give a model"
        if not isinstance(scene.motion, ScriptedMotion):
            return "its motion is a file of poses, so where to slide is unknown; give a model"
        return None

    def renderer(self, scene: Scene, dt: float) -> VibrationRenderer:
        """Return a renderer of a scene; without a model, it is fitted first."""
        base = SolverRenderer(without_textures(scene), scene.force, dt)
        model = self.model
        if model is None:
            sample = enlarge_sample(scene)
            runs = explore(sample, SPEEDS, FORCES, rate=1.0 / dt, seconds=_SECONDS, mass=self.mass)
            model = fit(runs, FitSettings(kind=self.kind), name=scene.name).model
        synthesiser = Synthesiser(at_rate(model, 1.0 / dt), seed=self.seed)
        return VibrationRenderer(base, synthesiser, place_bodies(scene).centre, self.mass, dt)


def enlarge_sample(scene: Scene) -> Scene:
    """Return the scene with a sample of its texture that is large enough to slide over.

    Recordings are made on samples as large as the strokes. A body of level boxes with a periodic
    texture becomes an unbounded plane; any other is left as it is.
    """
    _, (target,) = tool_and_others(scene)
    repeats = target.texture is not None and target.texture.border == "wrap"
    if not is_level(target) or not repeats or target.mapping != "planar":
        return scene
    root = ElementTree.fromstring(scene.xml)
    body = next(one for one in root.iter("body") if one.get("name") == target.name)
    top = max(map(top_of, target.geoms))
    for geom in body.findall("geom"):
        body.remove(geom)
    ElementTree.SubElement(body, "geom", type="plane", size="0 0 0.01", pos=f"0 0 {top:.9g}")
    xml = ElementTree.tostring(root, encoding="unicode")
    return scene_of(xml, scene.document, name=scene.name, folder=scene.folder)


RECORDED_VIBRATION = VibrationMethod()

RECORDED_HARMONIC = VibrationMethod(
    name="recorded-harmonic",
    label="recorded vibration, harmonic",
    what_it_is_not=(
        "Asperity's addition to the noise of the authors: what repeats over distance follows the "
        "travelled distance. Fitted to asperity's own forces; what does not repeat is noise."
    ),
    kind="harmonic",
)
"""The same with the lines locked to position of `vibrotactile.harmonic`."""
