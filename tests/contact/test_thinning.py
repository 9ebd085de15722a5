"""Convex polyhedra of many faces: directions near a shorter one do not count."""

import math

import numpy as np
import pytest
from naive_engine import pose, waves
from scipy.spatial.transform import Rotation

from contact.naive_meshes import STIFFNESS, block, engine_of, hull_mesh, roller, thing
from contact.test_mesh_potential import (
    compared,
    first_pose,
    pressed_together,
    push,
    random_polyhedra,
)


def solids(rng, kind):
    one = roller(3e-3 * rng.uniform(0.6, 1.2), 3e-3 * rng.uniform(0.3, 2.0), 48)
    if kind == "prism":
        return one, roller(3e-3 * rng.uniform(0.6, 1.2), 3e-3 * rng.uniform(0.3, 2.0), 48)
    if kind == "block":
        return one, block(3e-3 * rng.uniform(0.4, 1.2, 3))
    return one, hull_mesh(next(random_polyhedra(rng)))


@pytest.mark.parametrize("kind", ["prism", "block", "polyhedron"])
def test_prisms_of_many_sides_are_pushed_by_the_least_that_frees_them(kind):
    """With all directions nine tenths of the ways out were 0.97 of the least, forces up to 1.05."""
    rng, found = np.random.default_rng(0), []
    for _ in range(8):
        meshes = solids(rng, kind)
        one, two = (np.array(mesh.vertices) for mesh in meshes)
        engine = engine_of(*(thing(name, m) for name, m in zip("ab", meshes, strict=True)))
        for turn in range(4):
            depth = rng.uniform(5e-5, 3e-4)
            near = two[rng.integers(len(two))] if turn % 2 else None
            found.append(push(engine, pressed_together(rng, one, two, depth, near), depth))
    taken, forces, errors = compared(found)
    assert min(taken) > 0.9
    assert max(taken) < 1.02
    assert min(forces) > 0.65
    assert max(forces) < 1.03
    assert np.quantile(errors, 0.8) < 1e-6


@pytest.fixture(scope="module")
def rough_prisms():
    """A prism of 48 sides whose end touches the sides of another one, both rough."""
    tool = thing("tool", roller(4e-3, 6e-3, 48), waves(2e-4, 1.2e-3), "triplanar")
    plate = thing("plate", roller(10e-3, 15e-3, 48), waves(3e-4, 1.8e-3), "triplanar")
    return engine_of(tool, plate)


def on_the_sides(s):
    """Return a pose on a path along which the tool slides round the plate, turns and tilts."""
    around, out = 0.3 * s, 10e-3 + 6e-3 - 5e-5
    q = Rotation.from_euler("xyz", [math.pi / 2 + 0.02 * math.sin(9 * s), 0.1 * s, around])
    place = out * math.sin(around), -out * math.cos(around), 2e-3 * s
    return pose(*place, np.roll(q.as_quat(), 1))


def test_rough_prisms_leave_by_few_directions(rough_prisms):
    """Four or five counted all along, each with searches of its own."""
    found = []
    for s in np.linspace(0.0, 1.0, 60):
        first_pose(rough_prisms, on_the_sides(s))
        count, dropped = rough_prisms.contacts.count
        assert count > 0
        assert dropped == 0
        assert (rough_prisms.contacts.status[:count] == 0).all()
        found.append(len(np.unique(rough_prisms.contacts.normal[:count].round(9), axis=0)))
    assert np.mean(found) < 1.5
    assert max(found) <= 3


def test_the_way_out_of_rough_prisms_never_leaps(rough_prisms):
    """From one side of the plate to the next one, the way out takes small steps of one size."""
    lengths = []
    for s in np.arange(0.39, 0.47, 1e-4):
        first_pose(rough_prisms, on_the_sides(s))
        lengths.append(math.sqrt(2.0 * rough_prisms.energy / STIFFNESS))
    steps = np.abs(np.diff(lengths))
    assert min(lengths) > 3e-4
    assert steps.max() < 5e-7
