"""Scratch memory of the search, shared by solvers that run one after the other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from asperity.contact.body_arrays import Geometry
from asperity.contact.broad_phase.facet_bvh import FacetTable
from asperity.contact.narrow_phase.mesh_workspace import (
    MAX_CANDIDATES,
    MAX_SURFACE_PATCHES,
    FacetSpace,
    facet_space,
)
from asperity.contact.narrow_phase.workspace import Workspace, workspace


class SearchRoom(NamedTuple):
    """Scratch memory; nothing in it is kept from one pose to the next."""

    search: Workspace
    facets: FacetSpace | None
    """None without contact between facets."""


def search_room(geometry: Geometry, facets: FacetTable | None, by_geoms: bool = True) -> SearchRoom:
    """Allocate memory for searches between facets, if there are any, and between geoms."""
    geoms = most_geoms(geometry)
    patches, pairs = (3 * geoms, 9 * geoms * geoms) if by_geoms else (1, 1)
    if facets is None:
        return SearchRoom(workspace(patches, pairs), None)
    patches, pairs = max(patches, MAX_SURFACE_PATCHES), max(pairs, MAX_CANDIDATES)
    return SearchRoom(workspace(patches, pairs), facet_space(facets, len(geometry.kind)))


def most_geoms(geometry: Geometry) -> int:
    """Return the largest number of geoms of one body."""
    return int(np.bincount(geometry.body).max())
