"""Margins of textured geoms, so that MuJoCo reports contacts before their peaks touch."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from asperity.mujoco.bodies import CarriedBodies
from asperity.mujoco.flexes import FlexSurface
from asperity.mujoco.memory import margins

_FIELDS = (
    "geom_margin", "geom_gap", "pair_margin", "pair_gap", "body_margin", "flex_margin", "flex_gap"
)  # fmt: skip


def widen(
    model: mujoco.MjModel, carried: CarriedBodies, flexes: tuple[FlexSurface, ...]
) -> Callable[[], None]:
    """Widen the gaps of textured geoms and flexes by their heights; return a function to undo it.

    Contacts in the gap are reported without a force, so that results of `mj_step` do not change. Up
    to MuJoCo 3.9 the gap is the outer part of the margin, which is then widened too.
    """
    fields = [name for name in _FIELDS if hasattr(model, name)]
    before = {name: np.array(getattr(model, name)) for name in fields}
    known = margins()
    own, of_flexes = carried.top.copy(), np.zeros(model.nflex)
    of_flexes[[one.flex for one in flexes]] = [one.top for one in flexes]
    if not known.adds:  # then the larger of two is used, and has to cover both heights
        most = max(float(own.max(initial=0.0)), float(of_flexes.max(initial=0.0)))
        own[own > 0.0] += most
        of_flexes[of_flexes > 0.0] += most
    own = own[: model.ngeom]
    _add(model, "flex", of_flexes, known.gap_reaches_out)
    _add(model, "geom", own, known.gap_reaches_out)
    if model.npair:
        both = own[model.pair_geom1] + own[model.pair_geom2]
        _add(model, "pair", both, known.gap_reaches_out)
    if "body_margin" in fields:
        for geom in np.flatnonzero(own > 0.0).tolist():
            body, reach = int(model.geom_bodyid[geom]), float(model.geom_margin[geom])
            reach += float(model.geom_gap[geom]) if known.gap_reaches_out else 0.0
            model.body_margin[body] = max(float(model.body_margin[body]), reach)

    def undo() -> None:
        for name, values in before.items():
            getattr(model, name)[:] = values

    return undo


def _add(model: mujoco.MjModel, kind: str, heights: np.ndarray, gap_reaches_out: bool) -> None:
    """Add heights to the gaps of geoms or pairs, and to the margins if they hold the gaps."""
    getattr(model, f"{kind}_gap")[:] += heights
    if not gap_reaches_out:
        getattr(model, f"{kind}_margin")[:] += heights
