"""The interface of a rendering method: whether it can render a scene, and the wrench at a pose.

Every approach that asperity is compared with is one file, with its formula, its source and how it
differs from it. A *method* is constant; its `prepare` returns a *renderer* of one scene, which
holds all state and returns a wrench each tick. Preparation (grids, hierarchies, filters) is not
part of the cost of a tick.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.scene.scene import Scene


class MethodWrench(NamedTuple):
    """The contact wrench on a tool at a pose, computed by some method."""

    force: NDArray[np.float64]
    """Force on the tool, world axes [N], (3,)."""
    torque: NDArray[np.float64]
    """Torque about the tool's centre of mass, world axes [N m], (3,). Zero if a method has none."""
    depth: float
    """The largest penetration depth that the method found [m]; 0 without contact."""
    contacts: int
    """Number of contacts: points, pairs of triangles or patches, depending on the method."""


NOTHING = MethodWrench(np.zeros(3), np.zeros(3), 0.0, 0)
"""The wrench on a tool that touches nothing."""


class Renderer(Protocol):
    """A method prepared for one scene. Equal poses after `reset` give equal wrenches."""

    def wrench(self, pose: NDArray[np.float64]) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,): position [m], unit quaternion wxyz.

        Consecutive poses are one tick, the `dt` of `prepare`, apart. The caller owns the returned
        arrays.
        """
        ...

    def reset(self) -> None:
        """Forget all previous poses; by default there is nothing to forget."""
        return


@dataclass(frozen=True)
class Method:
    """One way to render contact; a subclass makes the renderers, and may refuse scenes.

    Parameters
    ----------
    name : str
        Key of the method: lower case, with hyphens.
    label : str
        Name in figures and tables.
    source : str
        Author and year.
    what_it_is_not : str
        One or two sentences on how it differs from what its authors built.
    """

    name: str
    label: str
    source: str
    what_it_is_not: str

    def can(self, scene: Scene) -> str | None:
        """Return in a few words why the method cannot render a scene; None if it can."""
        return None

    def renderer(self, scene: Scene, dt: float) -> Renderer:
        """Return a renderer of a scene that the method can render, for ticks of `dt` [s]."""
        raise NotImplementedError

    def prepare(self, scene: Scene, *, dt: float = 1e-3) -> Renderer:
        """Return a renderer of a scene whose poses come `dt` [s] apart.

        Raises
        ------
        AsperityError
            If the method cannot render the scene, with the reason that `can` returns.
        """
        reason = self.can(scene)
        if reason is not None:
            raise AsperityError(f"{self.label} cannot render scene {scene.name!r}: {reason}")
        return self.renderer(scene, dt)
