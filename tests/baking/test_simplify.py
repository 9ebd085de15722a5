"""Fewer triangles, and what was closed stays closed."""

import numpy as np
import pytest
import trimesh
from scans import displaced_finely, ellipsoid, ripples

from asperity.baking.nearest import Nearest
from asperity.baking.simplify import joined_places, simplified, soundness
from asperity.geometry.mesh.files import read_mesh
from asperity.geometry.mesh.mesh import mesh_from_arrays


def _euler(faces):
    sides = np.sort(np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    return len(np.unique(faces)) - len(np.unique(sides, axis=0)) + len(faces)


@pytest.mark.parametrize("faces", [40, 300])
def test_a_closed_mesh_stays_closed_and_near(faces):
    vertices, triangles = displaced_finely(ellipsoid(2), ripples, 6)
    low = simplified(mesh_from_arrays(vertices, triangles), faces)
    assert len(low.faces) == faces
    points, at = joined_places(low)
    assert soundness(points, at)[:3] == (0, 0, 0)
    assert _euler(at) == 2
    assert "it is closed as it was" in low.notes
    away = Nearest(low.vertices[low.faces]).to(vertices)[1]
    assert away.max() < {40: 3e-3, 300: 8e-4}[faces]


def test_a_hole_through_a_body_stays_one():
    ring = trimesh.creation.torus(0.03, 0.01, major_sections=60, minor_sections=40)
    low = simplified(mesh_from_arrays(ring.vertices, ring.faces), 120)
    points, at = joined_places(low)
    assert len(low.faces) == 120
    assert soundness(points, at)[:2] == (0, 0)
    assert _euler(at) == 0


def test_an_open_sheet_keeps_its_border_and_a_flat_one_its_plane():
    x, y = np.meshgrid(np.linspace(0.0, 0.04, 21), np.linspace(0.0, 0.02, 11))
    points = np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3)
    k = np.arange(points.shape[0]).reshape(x.shape)
    a, b, c, d = (q.ravel() for q in (k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]))
    sheet = mesh_from_arrays(
        points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    )
    low = simplified(sheet, 20)
    assert len(low.faces) <= 24
    assert np.ptp(low.vertices, axis=0) == pytest.approx([0.04, 0.02, 0.0], abs=1e-12)
    area = np.linalg.norm(
        np.cross(*(np.diff(low.vertices[low.faces], axis=1).swapaxes(0, 1))), axis=1
    )
    assert 0.5 * area.sum() == pytest.approx(8e-4, rel=1e-9)


def test_a_tetrahedron_is_the_least_of_a_ball():
    low = simplified(ellipsoid(2), 4)
    assert 4 <= len(low.faces) <= 8
    assert _euler(joined_places(low)[1]) == 2


@pytest.mark.parametrize(
    ("name", "unit", "faces"), [("featuretype.STL", "cm", 800), ("idler_riser.STL", "cm", 300)]
)
def test_machined_parts_keep_their_shape(data, name, unit, faces):
    mesh = read_mesh(data / "meshes" / name, unit=unit, hard_angle=180.0)
    low = simplified(mesh, faces)
    assert len(low.faces) == faces
    assert soundness(*joined_places(low))[:3] == (0, 0, 0)
    away = Nearest(low.vertices[low.faces]).to(mesh.vertices)[1]
    assert away.max() < 0.012 * np.ptp(mesh.vertices, axis=0).max()
