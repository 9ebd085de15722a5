"""Asperity's own model, and any other force law of its contact solver, as methods.

*asperity*: Otaduy & Lin (2004), `F = k w delta m` at the deepest place of the two textured
surfaces, by certified depths and exact gradients; see `contact.response`. The point methods with
their authors' own contact are in `point_methods` and `choi_tan`.

It runs without anti-aliasing: it returns the wrench at the pose, not a mean over the tick.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from asperity.contact.response.settings import ForceSettings
from asperity.contact.solver import ContactSolver
from asperity.scene.scene import Scene
from asperity.simulation.tool_contact import announce_compiling
from asperity.studies.baselines.protocol import NOTHING, Method, MethodWrench, Renderer


class SolverRenderer(Renderer):
    """Renders a scene by its `ContactSolver`."""

    def __init__(self, scene: Scene, settings: ForceSettings, dt: float) -> None:
        announce_compiling()
        self.solver = ContactSolver(scene.model, scene.bodies, scene.tool, settings)
        self._dt = dt

    def wrench(self, pose: NDArray[np.float64]) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        wrench = self.solver.wrench(pose, self._dt)
        count = int(self.solver.contacts.count[0])
        if count == 0:
            return NOTHING
        depth = float(self.solver.contacts.depth[:count].max())
        return MethodWrench(wrench[:3].copy(), wrench[3:].copy(), depth, count)

    def reset(self) -> None:
        """Forget all previous poses."""
        self.solver.reset()


@dataclass(frozen=True)
class SolverMethod(Method):
    """One of the force laws of the contact solver.

    Parameters
    ----------
    law : str
        One of the laws of `ForceSettings`.
    """

    law: str

    def can(self, scene: Scene) -> str | None:
        """Return why the law cannot render a scene, or None."""
        if self.law == "otaduy-lin":
            return None
        mesh = next((body.name for body in scene.bodies if body.mesh is not None), None)
        return (
            None if mesh is None else f"a law of one point on simple solids, and {mesh} is a mesh"
        )

    def renderer(self, scene: Scene, dt: float) -> SolverRenderer:
        """Return a renderer with the scene's friction, stiffness and parameters of the law."""
        # The gradient setting of the scene's law does not apply to another law.
        changes = {} if scene.force.law == self.law else {"law": self.law, "gradient": None}
        return SolverRenderer(scene, scene.changed(force=changes).force, dt)


ASPERITY = SolverMethod(
    "asperity",
    "asperity",
    "Otaduy & Lin 2004",
    "The paper's depths on a grid of its graphics card are replaced by certified ones, and its "
    "central differences by the exact gradient.",
    "otaduy-lin",
)
