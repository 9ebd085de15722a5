"""Sheets of triangles, textures and tools for the tests of deformable surfaces."""

import functools

import numpy as np

from asperity.contact.deformable.elastic_body import elastic_body
from asperity.contact.deformable.surface import DeformableSurface
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from rough_maps import bumps

LAYER = {"thickness": 3e-3, "modulus": 5e4, "pitch": 4e-4}
TURN = (0.9, 0.3, -0.2, np.sqrt(1.0 - 0.94))


def sheet(n=13, half=15e-3, height=lambda x, y: 0.0 * x):
    """Return an open sheet of 2 (n - 1)^2 triangles that faces up."""
    x, y = np.meshgrid(np.linspace(-half, half, n), np.linspace(-half, half, n))
    vertices = np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = (
        part.ravel() for part in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1])
    )  # fmt: skip
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return mesh_from_arrays(vertices, faces, name="sheet")


def wavy(n=13):
    """Return a sheet with hills of 2 mm."""
    return sheet(n, height=lambda x, y: 2e-3 * np.sin(x / 8e-3) * np.cos(y / 9e-3))


def tool():
    """Return a textured tool of a ball and a box."""
    geoms = [Geom("sphere", (6e-3,)), Geom("box", (3e-3, 3e-3, 3e-3), (5e-3, 0.0, -3e-3))]
    return Body("tool", geoms, bumps(3), "triplanar")


def slab(cells=(8, 8, 3), half=15e-3, height=12e-3):
    """Return nodes and tetrahedra of a slab below z = 0."""
    import skfem

    across = np.linspace(-half, half, cells[0] + 1)
    along = np.linspace(-half, half, cells[1] + 1)
    grid = skfem.MeshTet.init_tensor(across, along, np.linspace(-height, 0.0, cells[2] + 1))
    return grid.p.T.copy(), grid.t.T.copy()


@functools.cache
def soft_slab(modulus=2e4, **options):
    """Return an elastic slab that is held at its base."""
    nodes, tetrahedra = slab()
    options = {"density": 1000.0, "poisson": 0.4, "modes": 30} | options
    held = nodes[:, 2] < nodes[:, 2].min() + 1e-9
    return elastic_body(sheet(), nodes, tetrahedra, modulus=modulus, held=held, **options)


def surface_on(mesh, **options):
    """Return a deformable surface with the layer of these tests."""
    return DeformableSurface(mesh, **(LAYER | options))
