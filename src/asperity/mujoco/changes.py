"""Detection of changes of a model after textures were attached to it."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco
import numpy as np

from asperity.errors import AsperityError
from asperity.mujoco.bodies import Carried
from asperity.mujoco.names import geom_name

_FIELDS = ("geom_size", "geom_pos", "geom_quat", "geom_dataid", "geom_gap")


class AttachedModel:
    """Fields of a model that asperity uses, to compare with the current model."""

    def __init__(self, model: mujoco.MjModel, bodies: Iterable[Carried]) -> None:
        self._geoms = np.array(sorted({g for one in bodies for g in one.geoms}), np.int64)
        self._values = {name: getattr(model, name)[self._geoms] for name in _FIELDS}

    def check(self, model: mujoco.MjModel) -> None:
        """Refuse a model whose textured geoms, or geoms that touch them, were changed."""
        for name, old in self._values.items():
            now = getattr(model, name)[self._geoms]
            if not np.array_equal(now, old):
                row = int(np.flatnonzero((now != old).reshape(len(now), -1).any(axis=1))[0])
                raise AsperityError(
                    f"{name} of {geom_name(model, int(self._geoms[row]))} was changed after "
                    "textures were attached; attach them again"
                )
