"""What a method of rendering is asked: can it do a scene, and which wrench has a pose.

Every approach that asperity is compared with stands behind the same two protocols, each in a file
of its own with its formula, its source and what it is not. A *method* is constant and knows its
name; `prepare` makes a *renderer* of one scene, which holds all state and is asked tick by tick.
Preparing (grids, hierarchies, filters) is not part of a tick's cost.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from asperity.scene.scene import Scene


class MethodWrench(NamedTuple):
    """What a tool feels at a pose, by some method."""

    force: NDArray[np.float64]
    """On the tool, world axes [N], (3,)."""
    torque: NDArray[np.float64]
    """About the tool's centre of mass, world axes [N m], (3,). Zero where a method has none."""
    depth: float
    """The largest penetration depth that the method found [m]; 0 without contact."""
    contacts: int
    """How many contacts it counts: points, pairs of triangles or patches, as the method has it."""


NOTHING = MethodWrench(np.zeros(3), np.zeros(3), 0.0, 0)
"""Of a tool that touches nothing."""


class Renderer(Protocol):
    """A method made ready for one scene. The same poses after `reset` give the same wrenches."""

    def wrench(self, pose: NDArray[np.float64]) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,): position [m], unit quaternion wxyz.

        Poses follow each other by the tick that `prepare` was told. The arrays returned are the
        caller's to keep.
        """
        ...

    def reset(self) -> None:
        """Forget all poses so far."""
        ...


class Method(Protocol):
    """One way to render contact."""

    @property
    def name(self) -> str:
        """By which it is asked for: lower case, with hyphens."""
        ...

    @property
    def label(self) -> str:
        """As figures and tables have it."""
        ...

    @property
    def source(self) -> str:
        """Author and year."""
        ...

    @property
    def what_it_is_not(self) -> str:
        """One or two sentences: where this differs from what its authors built."""
        ...

    def can(self, scene: Scene) -> str | None:
        """Return why the method cannot render a scene, in a few words; None if it can."""
        ...

    def prepare(self, scene: Scene, *, dt: float = 1e-3) -> Renderer:
        """Return a renderer of a scene whose poses come `dt` [s] apart.

        Raises
        ------
        AsperityError
            If the method cannot render the scene: what `can` says.
        """
        ...
