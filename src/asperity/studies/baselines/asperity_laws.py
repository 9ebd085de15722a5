"""asperity's own model, and the point laws that stand in its engine, as methods.

*asperity*: Otaduy & Lin (2004), `F = k w delta m` at the deepest place of the two textured
surfaces, by certified depths and exact gradients; see `forces.laws`.

*Minsky* (1995), *Ho, Basdogan & Srinivasan* (1999) and *Siira & Pai* (1996) take the texture at the
one point where the smooth tool is deepest; their formulas stand in `forces.laws`.

All four are asked without anti-aliasing: the wrench at the pose, not a mean over the tick.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from asperity.contact.response.settings import ForceSettings
from asperity.contact.solver import ContactSolver
from asperity.scene.scene import Scene
from asperity.simulation.tool_contact import announce_compiling
from asperity.studies.baselines.placement import require
from asperity.studies.baselines.protocol import NOTHING, MethodWrench


class EngineRenderer:
    """An `ContactSolver` of a scene, asked tick by tick."""

    def __init__(self, scene: Scene, settings: ForceSettings, dt: float) -> None:
        announce_compiling()
        self.engine = ContactSolver(scene.model, scene.bodies, scene.tool, settings)
        self._dt = dt

    def wrench(self, pose: NDArray[np.float64]) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        wrench = self.engine.wrench(pose, self._dt)
        count = int(self.engine.contacts.count[0])
        if count == 0:
            return NOTHING
        depth = float(self.engine.contacts.depth[:count].max())
        return MethodWrench(wrench[:3].copy(), wrench[3:].copy(), depth, count)

    def reset(self) -> None:
        """Forget all poses so far."""
        self.engine.reset()


@dataclass(frozen=True)
class EngineMethod:
    """One of the laws of the engine.

    Parameters
    ----------
    name, label, source, what_it_is_not : str
        See `Method`.
    law : str
        One of `forces.settings.LAWS`.
    """

    name: str
    label: str
    source: str
    what_it_is_not: str
    law: str

    def can(self, scene: Scene) -> str | None:
        """Return why the law cannot render a scene, or None."""
        if self.law == "otaduy-lin":
            return None
        meshes = [body.name for body in scene.bodies if body.mesh is not None]
        if meshes:
            return f"a law of one point on simple solids, and {meshes[0]} is a mesh"
        return None

    def prepare(self, scene: Scene, *, dt: float = 1e-3) -> EngineRenderer:
        """Return a renderer of a scene; friction, stiffness and the law's own keys are its."""
        require(self.can(scene), self.label, scene)
        # A gradient that the scene asks of its own law is not for another.
        changes = {} if scene.force.law == self.law else {"law": self.law, "gradient": None}
        return EngineRenderer(scene, scene.changed(force=changes).force, dt)


ASPERITY = EngineMethod(
    "asperity",
    "asperity",
    "Otaduy & Lin 2004",
    "The paper's depths on a grid of its graphics card are replaced by certified ones, and its "
    "central differences by the exact gradient.",
    "otaduy-lin",
)
MINSKY = EngineMethod(
    "minsky",
    "Minsky",
    "Minsky 1995",
    "Her lateral force acts in a plane, without a normal force; here the depth times the stiffness "
    "is its gain.",
    "minsky",
)
HO = EngineMethod(
    "ho",
    "Ho et al.",
    "Ho, Basdogan & Srinivasan 1999",
    "Without their haptic interaction point's way along the surface (a god object with friction); "
    "the formula is recalled, not read in the source.",
    "ho",
)
SIIRA_PAI = EngineMethod(
    "siira-pai",
    "Siira & Pai",
    "Siira & Pai 1996",
    "The noise has one deviation over the normal force; theirs is fitted to a measured surface.",
    "siira-pai",
)
