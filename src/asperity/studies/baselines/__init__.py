"""Rendering methods to compare, behind one interface: `METHODS`, by name."""

from __future__ import annotations

from collections.abc import Iterable

from asperity.errors import require_choice
from asperity.studies.baselines import (
    asperity_laws,
    asperity_meshes,
    choi_tan,
    constraint,
    contact_levels,
    convex_pieces,
    full_meshes,
    local_minimum_distances,
    offset_sphere,
    otaduy_lin_2004,
    point_methods,
    recorded_vibration,
    voxmap,
)
from asperity.studies.baselines.protocol import Method, MethodWrench, Renderer

METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        asperity_laws.ASPERITY,
        otaduy_lin_2004.PUBLISHED,
        point_methods.MINSKY,
        point_methods.HO,
        point_methods.SIIRA_PAI,
        choi_tan.FIXED,
        choi_tan.NORMAL,
        choi_tan.GOD_OBJECT,
        voxmap.FULL,
        voxmap.LOW,
        contact_levels.CONTACT_LEVELS,
        contact_levels.LOW_RESOLUTION,
        constraint.CONSTRAINT,
        full_meshes.FULL_MESHES,
        asperity_meshes.MESHED,
        offset_sphere.OFFSET_SPHERE,
        convex_pieces.CONVEX_PIECES,
        local_minimum_distances.LOW,
        local_minimum_distances.DETAIL,
        recorded_vibration.RECORDED_VIBRATION,
        recorded_vibration.RECORDED_HARMONIC,
    )
}
"""Name -> method, in the order of tables and figures; asperity's own is the first."""


def choose_methods(names: Iterable[str]) -> list[Method]:
    """Return the methods with these names, all if none are given, in the order of `METHODS`."""
    wanted = {require_choice("method", name, METHODS) for name in names}
    return [method for name, method in METHODS.items() if not wanted or name in wanted]


__all__ = ["METHODS", "Method", "MethodWrench", "Renderer", "choose_methods"]
