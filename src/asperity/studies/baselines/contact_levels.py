r"""Contact levels of detail: each contact at the coarsest resolution within a tolerance.

Otaduy & Lin, *Sensation preserving simplification for haptic rendering* and *CLODs: dual
hierarchies for multiresolution collision detection* (both 2003). A mesh is simplified step by
step, each level a filtered one. Each contact takes the coarsest level whose surface deviation s,
weighted by the size of the removed features and averaged over the contact's area D, is below a
tolerance:

    s* = s / (r^2 D) < s_0,     r = 1 / (size of the smallest feature of that level)

So fine detail is dropped where the contact is wide. For shape that agrees with human perception;
for texture it removes what people would feel (Otaduy & Lin 2004, section 2.2).

The rule is quoted from memory, with medium confidence. Asperity's own are `s_0` and the levels: the
scene's base bodies with height fields low-passed at wavelengths that double from level to level,
down to no texture. The criterion applies to the same quantity, because a base displaced by a
band-limited map *is* a filtered surface with deviation `max |h - h_l|`; a hierarchy of simplified
meshes with hulls would cost less for each contact and render no more. D is the area of the tool's
smooth surface inside a body, counted with a coarse pointshell (see `voxmap`). The wrench of a
contact is asperity's, on the surfaces of its level.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import Body
from asperity.scene.scene import Scene
from asperity.studies.baselines import voxmap
from asperity.studies.baselines.asperity_laws import SolverRenderer
from asperity.studies.baselines.displaced_surfaces import smooth_area
from asperity.studies.baselines.placement import place_bodies, without_textures
from asperity.studies.baselines.protocol import NOTHING, Method, MethodWrench, Renderer

Array = NDArray[np.float64]
TOLERANCE = 10e-6
"""s_0 [m], asperity's."""
_MOST_LEVELS = 12


@dataclass(frozen=True, eq=False)
class Level:
    """All bodies of a scene at one resolution."""

    size: float
    """Shortest wavelength that is kept [m]; 0 for the full surfaces."""
    deviation: float
    """s: largest deviation of any surface from its full detail [m]."""
    bodies: tuple[Body, ...]

    def weighted(self, area: float) -> float:
        """Return s* [m] for a contact of an area [m^2]."""
        return self.deviation * self.size**2 / area if area > 0.0 else math.inf


def build_levels(scene: Scene) -> list[Level]:
    """Return the levels of a scene, the finest first, the last without texture."""
    shortest = scene.shortest_wavelength
    found = [Level(0.0, 0.0, scene.bodies)]
    if math.isinf(shortest):
        return found
    relief = max(b.texture.relief for b in scene.bodies if b.texture is not None)
    for i in range(1, _MOST_LEVELS + 1):
        size = shortest * 2.0**i
        bodies = tuple(
            replace(body, texture=None if body.texture is None else body.texture.low_passed(size))
            for body in scene.bodies
        )
        remaining = max((b.texture.relief for b in bodies if b.texture is not None), default=0.0)
        if remaining <= 1e-3 * relief or i == _MOST_LEVELS:
            break
        found.append(Level(size, _deviation(scene.bodies, bodies), bodies))
    smooth = without_textures(scene).bodies
    return [*found, Level(size, _deviation(scene.bodies, smooth), smooth)]


def _deviation(full: Sequence[Body], coarse: Sequence[Body]) -> float:
    """Return the largest deviation of the heights of coarse bodies from those of full ones [m]."""
    most = 0.0
    for one, other in zip(full, coarse, strict=True):
        if one.texture is not None:
            heights = 0.0 if other.texture is None else other.texture.samples
            most = max(most, float(np.abs(one.texture.samples - heights).max()))
    return most


class LevelsRenderer(Renderer):
    """Renders each contact of a scene at its own level.

    Parameters
    ----------
    scene : Scene
    dt : float
        Tick [s].
    tolerance : float
        s_0 [m].
    """

    def __init__(self, scene: Scene, dt: float, tolerance: float) -> None:
        self.levels = build_levels(scene)
        self._scene, self._dt, self._tolerance = scene, dt, tolerance
        bodies = place_bodies(scene)
        self._probe = voxmap.LOW.renderer(scene, dt)
        self._each = smooth_area(bodies.tool) / len(self._probe.shell.points)
        numbers = range(len(scene.bodies))
        self._number = [i for i in numbers if scene.bodies[i] is not bodies.tool]
        self._renderers: dict[tuple[int, int], SolverRenderer] = {}
        self.used_levels: dict[str, int] = {}
        """The level used for each body at the last pose."""

    def reset(self) -> None:
        """Forget all previous poses."""
        for renderer in self._renderers.values():
            renderer.reset()

    def level(self, area: float) -> int:
        """Return the coarsest level for a contact of an area [m^2]."""
        fit = [i for i, one in enumerate(self.levels) if one.weighted(area) < self._tolerance]
        return max(fit, default=0)

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        self._probe.wrench(pose)
        self.used_levels = {}
        parts = []
        for number, touching in zip(self._number, self._probe.touching, strict=True):
            level = self.level(touching * self._each)
            self.used_levels[self._scene.bodies[number].name] = level
            part = self._renderer(level, number).wrench(pose)
            if part.contacts:
                parts.append(part)
        if not parts:
            return NOTHING
        return MethodWrench(
            np.sum([part.force for part in parts], axis=0),
            np.sum([part.torque for part in parts], axis=0),
            max(part.depth for part in parts),
            sum(part.contacts for part in parts),
        )

    def _renderer(self, level: int, number: int) -> SolverRenderer:
        """Return the renderer of the tool against one body, at one level."""
        if (level, number) not in self._renderers:
            scene = self._scene
            bodies = self.levels[level].bodies
            two = tuple(b for i, b in enumerate(bodies) if i == number or b.name == scene.tool)
            pair = replace(scene, bodies=two)
            self._renderers[level, number] = SolverRenderer(pair, scene.force, self._dt)
        return self._renderers[level, number]


@dataclass(frozen=True)
class LevelsMethod(Method):
    """Contact levels of detail.

    Parameters
    ----------
    tolerance : float
        s_0 [m].
    """

    name: str = "contact-levels"
    label: str = "contact levels of detail"
    source: str = "Otaduy & Lin 2003"
    what_it_is_not: str = (
        "Levels of height fields on one base body, not of simplified meshes; the criterion is "
        "recalled, and the tolerance is asperity's."
    )
    tolerance: float = TOLERANCE

    def renderer(self, scene: Scene, dt: float) -> LevelsRenderer:
        """Return a renderer of a scene."""
        return LevelsRenderer(scene, dt, self.tolerance)


@dataclass(frozen=True)
class SmoothMethod(Method):
    """The low-resolution bodies alone, without texture: the limit of filtering."""

    name: str = "low-resolution"
    label: str = "low resolution alone"
    source: str = "the base of Otaduy & Lin 2003 and 2004"
    what_it_is_not: str = "No texture at all: the contact of the base bodies, for comparison."

    def renderer(self, scene: Scene, dt: float) -> SolverRenderer:
        """Return a renderer of a scene."""
        return SolverRenderer(without_textures(scene), scene.force, dt)


CONTACT_LEVELS = LevelsMethod()
LOW_RESOLUTION = SmoothMethod()
