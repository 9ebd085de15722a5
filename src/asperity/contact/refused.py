"""Checks for settings and bodies that a kind of contact does not support."""

from __future__ import annotations

from collections.abc import Sequence

from asperity.contact.response.settings import ForceSettings
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body


def refuse_soft_bodies(bodies: Sequence[Body]) -> None:
    """Refuse bodies that are not rigid."""
    for body in bodies:
        if not isinstance(body, Body):
            raise AsperityError(
                f"a rigid contact has bodies (Body), got a {type(body).__name__}; what is soft "
                "meets them by SkinContact, SurfaceContact or ElasticContact, and no other soft one"
            )


def refuse_for_maps(settings: ForceSettings, tool: str | None, others: list[str | None]) -> None:
    """Refuse stiffness maps where they are not supported; names are those of bodies with one."""
    names = [name for name in (tool, *others) if name is not None]
    if names:
        refuse_laws(settings, f"where stiffness is a map, as that of body {names[0]!r}")
    if tool is not None and len(names) > 1:
        raise AsperityError(
            f"stiffness of {names[0]!r} and of {names[1]!r}, which may touch, are maps; valid: a "
            "map for one of them, a number for the other"
        )


def refuse_laws(settings: ForceSettings, where: str) -> None:
    """Refuse laws and gradients that this contact does not support."""
    for name, value, only in (
        ("law", settings.law, "otaduy-lin"),
        ("gradient", settings.gradient, "exact"),
    ):
        if value != only:
            raise AsperityError(f"{where}, {name} must be {only!r}, got {value!r}")
