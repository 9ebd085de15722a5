"""Friction that MJCF gives to geoms, as that of surfaces or of the whole scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import mujoco
import numpy as np

from asperity.contact.response.settings import ForceSettings
from asperity.geometry.bodies import Body, Surface
from asperity.scene.document import Table, at
from asperity.scene.mjcf import is_touchable


def frictions(model: mujoco.MjModel, tool: int, notes: list[str]) -> dict[int, float]:
    """Return coefficients of the geoms that may touch, the larger of which counts in a pair.

    They are one if all contacts of the tool have the same.

    Parameters
    ----------
    model : mujoco.MjModel
    tool : int
        Number of the body that is held.
    notes : list of str
        Gets one if no coefficients of geoms give what MuJoCo takes for the pairs.
    """
    touched = [i for i in range(model.ngeom) if is_touchable(model, i)]
    welded = model.body_weldid[model.geom_bodyid[touched]] == model.body_weldid[tool]
    mine = [i for i, own in zip(touched, welded, strict=True) if own]
    others = [i for i, own in zip(touched, welded, strict=True) if not own]
    if not mine or not others:
        return {}
    pairs = np.array([[_of_pair(model, i, j) for j in others] for i in mine])
    if np.ptp(pairs) == 0.0:
        return dict.fromkeys(mine + others, float(pairs[0, 0]))
    own = [model.geom_friction[geoms, 0] for geoms in (mine, others)]
    # If any values give these pairs by the larger one, so do the least of each row and column.
    for ones, twos in (own, (pairs.min(axis=1), pairs.min(axis=0))):
        if np.array_equal(np.maximum(ones[:, None], twos), pairs):
            return dict(zip(mine + others, np.concatenate([ones, twos]).tolist(), strict=True))
    shown = ", ".join(f"{value:.3g}" for value in np.unique(pairs)[:5])
    notes.append(
        f"friction of geoms is not used: by priority and condim it is {shown} in ways that no "
        "values of single geoms give; force.friction holds"
    )
    return {}


def _of_pair(model: mujoco.MjModel, i: int, j: int) -> float:
    """Return MuJoCo's coefficient of sliding friction between two geoms."""
    if max(model.geom_condim[i], model.geom_condim[j]) == 1:
        return 0.0
    first, second = model.geom_priority[i], model.geom_priority[j]
    if first != second:
        return float(model.geom_friction[i if first > second else j, 0])
    return float(max(model.geom_friction[i, 0], model.geom_friction[j, 0]))


def settings_with(
    force: ForceSettings, found: dict[int, float], table: Table, notes: list[str]
) -> tuple[ForceSettings, dict[int, float]]:
    """Return the settings, and the coefficients that geoms get; `force.friction` comes first.

    Parameters
    ----------
    force : ForceSettings
    found : dict of int to float
        Of `frictions`.
    table : mapping
        `[force]` of the document.
    notes : list of str
        Gets notes on what is used.
    """
    if not found:
        return force, {}
    values = sorted(set(found.values()))
    shown = ", ".join(f"{value:.4g}" for value in values[:5])
    if "friction" in table:
        if [table["friction"]] != values:
            notes.append(f"friction is {force.friction:.4g}, of force.friction; geoms have {shown}")
        return force, {}
    if len(values) > 1:
        notes.append(f"friction is that of the geoms, the larger one of two: {shown}")
        return force, found
    notes.append(f"friction is {shown}, as MuJoCo takes it from the geoms")
    return at("friction of geoms", lambda: replace(force, friction=values[0])), {}


def with_frictions(body: Body, values: Sequence[float], notes: list[str]) -> Body:
    """Return a body whose surfaces have friction, those excepted that have their own.

    Parameters
    ----------
    body : Body
    values : sequence of float
        Of its geoms in scene.xml.
    notes : list of str
        Gets one if a mesh has several.
    """
    key = f"friction of the geoms of {body.name!r}"
    if body.mesh is not None or len(set(values)) == 1:
        if len(set(values)) > 1:
            notes.append(
                f"{key}: {max(values):.4g}, the largest, since a mesh has one; put its parts into "
                "bodies of their own"
            )
        if body.friction is None:
            body = at(key, lambda: replace(body, friction=max(values)))
        if all(geom.surface is None for geom in body.geoms):
            return body
    made: dict[tuple[int, float], Surface] = {}
    own, geoms = body.surface, []
    for geom, value in zip(body.geoms, values, strict=True):
        surface = geom.surface or own
        if surface.friction is None:
            kind = id(geom.surface), value
            if kind not in made:
                made[kind] = at(key, partial(replace, surface, friction=value))
            geom = replace(geom, surface=made[kind])
        geoms.append(geom)
    return replace(body, geoms=geoms)
