"""Texture coordinates by xatlas for meshes that have none."""

from __future__ import annotations

import dataclasses

import numpy as np

from asperity._core.arrays import Array, Indices
from asperity.errors import AsperityError
from asperity.geometry.mesh.checks import SAME_PLACE, extents_of, length, refuse, same_places
from asperity.geometry.mesh.mesh import Mesh
from asperity.geometry.mesh.topology import crosses, edges_of
from asperity.geometry.mesh.uv import charts_of

_TEXELS = 1000
_PADDING = 4


def with_atlas(mesh: Mesh, *, texels: int = _TEXELS, padding: int = _PADDING) -> Mesh:
    """Return the mesh with texture coordinates: cut into charts, unwrapped and packed by xatlas.

    All charts have the same scale in both directions. The notes give the length that one unit of
    texture coordinates spans; a texture of that size appears undistorted. Within a chart lengths
    are preserved as far as a curved surface can be flattened.

    Parameters
    ----------
    mesh : Mesh
        Without texture coordinates (`dataclasses.replace(mesh, uv=None)` removes them).
    texels : int
        Width in texels of a square with the mesh's area while charts are packed; the whole texture
        is a little wider.
    padding : int
        Texels between charts, so that the spline of one does not reach the next.

    Returns
    -------
    Mesh
        The same triangles in the same order, with `uv` within 0..1.

    Raises
    ------
    AsperityError
        A mesh with texture coordinates; xatlas is not installed (`pip install 'asperity[bake]'`);
        one line.
    """
    if mesh.uv is not None:
        refuse(mesh.name, "it has texture coordinates; valid: a mesh with uv=None")
    try:
        import xatlas
    except ImportError:
        raise AsperityError(
            "texture coordinates need xatlas, which is not installed; "
            "valid: pip install 'asperity[bake]'"
        ) from None
    size = float(extents_of(mesh.vertices).max())
    # With split vertices, as in STL, xatlas would make each triangle a chart.
    places = same_places(mesh.vertices, SAME_PLACE * size)
    _, first = np.unique(places, return_index=True)
    # In units of the size, since xatlas drops triangles below an absolute area.
    points = ((mesh.vertices[first] - mesh.vertices.mean(axis=0)) / size).astype(np.float32)
    at = places[mesh.faces]
    area = 0.5 * np.linalg.norm(crosses(points[at].astype(np.float64)), axis=1).sum()
    charts, packing = xatlas.ChartOptions(), xatlas.PackOptions()
    # By default both may mirror charts, and mirrored grain feels different.
    charts.fix_winding, packing.rotate_charts = True, False
    packing.texels_per_unit, packing.padding = texels / np.sqrt(area), padding
    atlas = xatlas.Atlas()
    atlas.add_mesh(points, at.astype(np.uint32))
    atlas.generate(charts, packing)
    origin, faces, coordinates = atlas[0]
    if not np.array_equal(origin[faces], at) or atlas.atlas_count != 1:
        refuse(mesh.name, "xatlas did not lay all its triangles on one texture")
    # Both are fractions of the atlas, whose sides differ: one scale for both.
    sides = np.array([atlas.width, atlas.height], dtype=np.float64)
    uv = coordinates[faces].astype(np.float64) * (sides / sides.max())
    note = _scale_note(mesh, uv, at)
    uv.setflags(write=False)
    return dataclasses.replace(mesh, uv=uv, notes=(*mesh.notes, note))


def _scale_note(mesh: Mesh, uv: Array, at: Indices) -> str:
    area = np.linalg.norm(crosses(mesh.vertices[mesh.faces]), axis=1)
    flat = np.concatenate([uv, np.zeros((*uv.shape[:2], 1))], axis=2)
    on_texture = np.linalg.norm(crosses(flat), axis=1)
    spans = float(np.sqrt(area.sum() / max(on_texture.sum(), 1e-300)))
    charts = charts_of(uv, at, edges_of(at)).max() + 1
    laid = on_texture > 0.0
    stretch = np.sort(spans * np.sqrt(on_texture[laid] / area[laid])) - 1.0
    low, high = 100.0 * stretch[[len(stretch) // 20, -1 - len(stretch) // 20]]
    return (
        f"texture coordinates by xatlas: {charts} charts on {50.0 * on_texture.sum():.3g} % of "
        f"the texture; one unit spans {spans:.6g} m ({length(spans)}), for nine triangles of ten "
        f"within {low:+.2g} and {high:+.2g} %"
    )
