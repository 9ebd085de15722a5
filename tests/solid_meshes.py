"""Closed meshes of simple shapes, and rigid bodies of them, for the tests of soft contact."""

import numpy as np
import trimesh

from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays


def body_of(mesh, texture=None, mapping="triplanar", name="solid"):
    """Return a rigid body of a mesh."""
    return Body(name, [Geom("mesh", (1.0, 1.0, 1.0))], texture, mapping, mesh=mesh)


def ball(radius=6e-3, cuts=3, **options):
    """Return an icosahedron cut in four `cuts` times, with the normals of the ball."""
    made = trimesh.creation.icosphere(subdivisions=cuts, radius=radius)
    normals = None if "hard_angle" in options else made.vertices
    return mesh_from_arrays(made.vertices, made.faces, normals=normals, **options)


def ball_with_seams(radius=6e-3, cuts=3):
    """Return a ball with texture coordinates that leap at a meridian."""
    mesh = ball(radius, cuts)
    x, y, z = np.moveaxis(mesh.vertices[mesh.faces], 2, 0)
    u = np.arctan2(y, x) / (2.0 * np.pi)
    u -= np.round(u - u[:, :1])
    uv = np.stack([5.3 * u, 2.0 * np.arcsin(z / radius) / np.pi], axis=2)
    return mesh_from_arrays(mesh.vertices, mesh.faces, normals=mesh.normals, uv=uv)


def box(half, middle=(0.0, 0.0, 0.0)):
    """Return twelve triangles."""
    made = trimesh.creation.box(2.0 * np.asarray(half))
    return mesh_from_arrays(made.vertices + middle, made.faces)


def cylinder(radius, half, sides=24):
    """Return a round side and two flat ends, z along the axis."""
    made = trimesh.creation.cylinder(radius, 2.0 * half, sections=sides)
    return mesh_from_arrays(made.vertices, made.faces)


def step(half=8e-3, low=-4e-3, high=4e-3):
    """Return a body of two blocks: below z = 0 for x < 0, up to `high` for x > 0; -z is flat."""
    profile = np.array([(-half, low), (half, low), (half, high), (0.0, high), (0.0, 0.0),
                        (-half, 0.0)])  # fmt: skip
    ends = [np.column_stack([profile[:, 0], np.full(6, y), profile[:, 1]]) for y in (-half, half)]
    caps = np.array([(0, 1, 4), (0, 4, 5), (1, 2, 4), (2, 3, 4)])
    k, after = np.arange(6), (np.arange(6) + 1) % 6
    sides = [np.stack([k, k + 6, after], axis=1), np.stack([after, k + 6, after + 6], axis=1)]
    return mesh_from_arrays(np.concatenate(ends), np.concatenate([caps, caps[:, ::-1] + 6, *sides]))
