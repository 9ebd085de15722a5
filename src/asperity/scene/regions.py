"""A texture, a friction and a stiffness for each material of a mesh.

The contact knows one texture a body. So the maps of the materials lie above each other in it,
sample by sample, and the mesh's texture coordinates point into it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.errors import AsperityError, did_you_mean
from asperity.geometry.bodies import Surface
from asperity.geometry.mesh.mesh import Mesh
from asperity.scene.document import PLACING, Table, at
from asperity.scene.texture import TOUCH, body_texture, with_touch
from asperity.texture.height_field import HeightField

_MARGIN = 12
"""Samples round those that are used: the spline forgets what lies farther away (0.27^12 = 1e-7)."""
_BETWEEN = 16
"""Samples of transition from one map to the next."""
_SMOOTH = 8
"""Samples along a side of the zeros that stand for a material without a map."""


class _Region(NamedTuple):
    """A map as far as it is used, and the places of corners in it [samples], (m, 3, 2)."""

    heights: Array
    places: Array


def material_surface(
    mesh: Mesh | None, tables: Table, key: str, folder: Path | None, own: Surface
) -> tuple[Mesh, Surface]:
    """Return a mesh and its surface with textures, friction and stiffness of its materials.

    Parameters
    ----------
    mesh : Mesh
        From a file with materials.
    tables : mapping
        The table of each material, by its name: of its texture, with friction and stiffness.
    key : str
        Their dotted key.
    folder : Path or None
        Where the tables' files lie.
    own : Surface
        Of the body; without a texture.
    """
    if mesh is None or not mesh.materials:
        raise AsperityError(f"{key}: valid for a mesh whose file has materials or groups")
    materials = list(mesh.materials)
    names = [material.name for material in materials]
    fields: dict[int, HeightField] = {}
    for name, given in tables.items():
        where = f"{key}.{name}"
        if name not in names:
            hint = did_you_mean(name, names)
            raise AsperityError(f"{where}: no such material{hint}; it has: {', '.join(names)}")
        number = names.index(name)
        materials[number] = with_touch(materials[number], given, where)
        table = {word: value for word, value in given.items() if word not in TOUCH}
        if not table:
            continue
        if mesh.uv is None:
            raise AsperityError(
                f"{where}: valid for a mesh with texture coordinates; without them: friction, "
                "stiffness"
            )
        if own.texture is not None:
            raise AsperityError(f"{key}: valid without a texture of the whole body; leave one out")
        if any(table.get(word, "uv") != "uv" for word in PLACING):
            raise AsperityError(f"{where}: valid: mapping 'uv', and no offset")
        field, _ = body_texture(table, where, folder)
        if field is not None:
            fields[number] = field
    mesh = replace(mesh, materials=tuple(materials))
    if not fields:
        return mesh, own
    if own.friction_map is not None or own.stiffness_map is not None:
        raise AsperityError(
            f"{key}: valid without a map of friction or stiffness of the whole body, whose texture "
            "coordinates they change; leave one out"
        )
    laid, texture = at(key, partial(laid_together, mesh, fields))
    return laid, replace(own, texture=texture, mapping="uv")


def laid_together(mesh: Mesh, fields: Mapping[int, HeightField]) -> tuple[Mesh, HeightField]:
    """Return a mesh with texture coordinates in one map of several, and that map.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates and materials.
    fields : mapping of int to HeightField
        The map of each material that has one; the others are smooth.
    """
    assert mesh.uv is not None
    assert mesh.material is not None
    uv = np.empty_like(mesh.uv)
    regions, at_rows = [], []
    row = 0
    for number in np.unique(mesh.material):
        which = mesh.material == number
        field = fields.get(int(number))
        region = _smooth(mesh.uv[which]) if field is None else _cut(field, mesh.uv[which])
        uv[which] = region.places + np.array([0.5, 0.5 + row])
        regions.append(region.heights)
        at_rows.append(row)
        row += len(region.heights) + _BETWEEN
    shape = row - _BETWEEN, max(heights.shape[1] for heights in regions)
    samples = np.empty(shape)
    for start, heights in zip(at_rows, regions, strict=True):
        end = start + len(heights)
        samples[start:end, : heights.shape[1]] = heights
        samples[start:end, heights.shape[1] :] = heights[:, -1:]
        if start:
            step = np.arange(1, _BETWEEN + 1)[:, None] / (_BETWEEN + 1)
            before = start - _BETWEEN
            samples[before:start] = (1.0 - step) * samples[before - 1] + step * samples[start]
    pixels = np.array([field.pixel_size for field in fields.values()]).min(axis=0)
    notes = [
        f"{mesh.materials[number].name}: {note}"
        for number, field in fields.items()
        for note in field.notes
    ]
    notes.append(
        f"the maps of {len(fields)} of its {len(mesh.materials)} materials are one texture of "
        f"{shape[1]} x {shape[0]} samples"
    )
    uv /= shape[::-1]
    uv.setflags(write=False)
    texture = HeightField(samples, (float(pixels[0]), float(pixels[1])), "clamp", notes)
    return replace(mesh, uv=uv), texture


def _cut(field: HeightField, uv: Array) -> _Region:
    """Return the part of a map that texture coordinates (m, 3, 2) use."""
    wraps = field.border == "wrap"
    if wraps:  # whole repeats make no difference
        uv = uv - np.floor(uv.min(axis=1, keepdims=True) + 1e-9)
    counts = field.samples.shape[::-1]
    places = uv * counts - 0.5
    picked, low = [], []
    for axis in (0, 1):
        first = int(np.floor(places[..., axis].min())) - _MARGIN
        last = int(np.ceil(places[..., axis].max())) + _MARGIN
        inside = uv[..., axis].min() > -1e-6 and uv[..., axis].max() < 1.0 + 1e-6
        picked.append(_samples(np.arange(first, last + 1), counts[axis], wraps, inside))
        low.append(first)
    return _Region(field.samples[np.ix_(picked[1], picked[0])], places - low)


def _samples(index: Indices, count: int, wraps: bool, inside: bool) -> Indices:
    """Return which samples of `count` lie at indices beyond the border."""
    if wraps:
        return index % count
    if not inside:
        return np.clip(index, 0, count - 1)
    index = index % (2 * count)  # its spline is that of the mirrored map
    return np.where(index < count, index, 2 * count - 1 - index)


def _smooth(uv: Array) -> _Region:
    """Return zeros, with texture coordinates (m, 3, 2) stretched over them."""
    low, high = uv.min(axis=(0, 1)), uv.max(axis=(0, 1))
    shares = (uv - low) / np.maximum(high - low, 1e-12)
    size = _SMOOTH + 2 * _MARGIN
    return _Region(np.zeros((size, size)), _MARGIN + (_SMOOTH - 1) * shares)
