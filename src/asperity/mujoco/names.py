"""Resolution of names to geoms and flexes of a MuJoCo model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import mujoco
import numpy as np

from asperity.errors import AsperityError, did_you_mean

_KINDS = ("geom", "body", "material", "flex")
_OBJECTS = {
    "geom": mujoco.mjtObj.mjOBJ_GEOM,
    "body": mujoco.mjtObj.mjOBJ_BODY,
    "material": mujoco.mjtObj.mjOBJ_MATERIAL,
    "flex": mujoco.mjtObj.mjOBJ_FLEX,
}
_NO_SURFACE = {
    "tendon": (mujoco.mjtObj.mjOBJ_TENDON, "a tendon has no surface"),
    "skin": (mujoco.mjtObj.mjOBJ_SKIN, "a skin is only seen"),
    "site": (mujoco.mjtObj.mjOBJ_SITE, "a site is never touched"),
}


class Named(NamedTuple):
    """The geoms or the flex of one name, and the value given for it."""

    kind: str
    """"geom", "body", "material" or "flex"."""
    name: str
    geoms: tuple[int, ...]
    value: Any
    flex: int = -1
    """Number of the flex."""


def touchable(model: mujoco.MjModel) -> np.ndarray:
    """Return whether each geom takes part in collisions, (ngeom,) bool."""
    found = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    if model.npair:
        found[model.pair_geom1] = found[model.pair_geom2] = True
    return np.asarray(found)


def resolve(model: mujoco.MjModel, textures: Mapping[str, Any]) -> list[Named]:
    """Return the geoms of every name of `textures`, the least specific names first.

    Parameters
    ----------
    model : mujoco.MjModel
    textures : mapping
        By the name of a geom, a body, a material or a flex; "geom:NAME", "body:NAME",
        "material:NAME" and "flex:NAME" where one name means several.

    Raises
    ------
    AsperityError
        A name that does not exist, has only geoms without collisions, or is ambiguous; one line.
    """
    if not isinstance(textures, Mapping):
        raise AsperityError(f"textures must be a mapping of names to textures, got {textures!r}")
    found = [_named(model, str(name), value) for name, value in textures.items()]
    return sorted(found, key=lambda one: -_KINDS.index(one.kind))


def _named(model: mujoco.MjModel, name: str, value: Any) -> Named:
    kind, colon, rest = name.partition(":")
    kinds = (kind,) if colon and kind in _KINDS else _KINDS
    plain = rest if colon and kind in _KINDS else name
    meant = {}
    for one in kinds:
        number = mujoco.mj_name2id(model, _OBJECTS[one], plain)
        if number >= 0:
            meant[one] = number
    if not meant:
        raise AsperityError(_unknown(model, plain, kinds))
    if "flex" in meant and len(meant) == 1:
        return _named_flex(model, meant["flex"], plain, value)
    can_be_touched = touchable(model)
    flex = [("flex", (-1,))] if meant.pop("flex", None) is not None else []
    sets = {one: _geoms(model, one, number) for one, number in meant.items()}
    useful = {one: [g for g in geoms if can_be_touched[g]] for one, geoms in sets.items()}
    useful = {one: geoms for one, geoms in useful.items() if geoms}
    if not useful:
        one = next(iter(meant))
        raise AsperityError(
            f"{one} {plain!r} has no geom that can be touched (contype and conaffinity are 0)"
            if sets[one]
            else f"{one} {plain!r} has no geoms"
        )
    several = [*useful.items(), *flex]
    if len({tuple(geoms) for _, geoms in several}) > 1:
        choices = " or ".join(f"'{one}:{plain}'" for one, _ in several)
        shown = " and a ".join(one for one, _ in several)
        raise AsperityError(f"{plain!r} names a {shown}; say {choices}")
    one, geoms = next(iter(useful.items()))
    return Named(one, plain, tuple(geoms), value)


def _named_flex(model: mujoco.MjModel, number: int, name: str, value: Any) -> Named:
    """Return the flex of a name, if it takes part in collisions."""
    if not (model.flex_contype[number] or model.flex_conaffinity[number]):
        raise AsperityError(
            f"flex {name!r} can not be touched (contype and conaffinity are 0); valid: a flex "
            "that takes part in collisions"
        )
    return Named("flex", name, (), value, number)


def _geoms(model: mujoco.MjModel, kind: str, number: int) -> list[int]:
    """Return the geoms of a geom, a body or a material."""
    if kind == "geom":
        return [number]
    owner = model.geom_bodyid if kind == "body" else model.geom_matid
    return np.flatnonzero(owner == number).tolist()


def _unknown(model: mujoco.MjModel, name: str, kinds: tuple[str, ...]) -> str:
    """Return the message about a name that no geom, body or material has."""
    for kind, (number, why) in _NO_SURFACE.items():
        if mujoco.mj_name2id(model, number, name) >= 0:
            return f"{name!r} is a {kind}: {why}; textures are by geom, body, material or flex"
    known = [n for kind in kinds for n in _names(model, kind)]
    hint = did_you_mean(name, known)
    if not hint and known:
        shown = ", ".join(known[:8]) + (", ..." if len(known) > 8 else "")
        hint = f"; there are {shown}"
    return f"no {' or '.join(kinds)} named {name!r} in the model{hint}"


def _names(model: mujoco.MjModel, kind: str) -> list[str]:
    counts = {
        "geom": model.ngeom, "body": model.nbody, "material": model.nmat, "flex": model.nflex
    }  # fmt: skip
    names = [mujoco.mj_id2name(model, _OBJECTS[kind], i) for i in range(counts[kind])]
    return [name for name in names if name]


def geom_name(model: mujoco.MjModel, geom: int) -> str:
    """Return the name of a geom for messages."""
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom)
    if name:
        return f"geom {name!r}"
    owner = int(model.geom_bodyid[geom])
    body = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, owner)
    return f"geom {geom} of body {body or owner!r}"
