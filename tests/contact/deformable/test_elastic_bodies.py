"""Elastic bodies in modal form: against closed forms, at rest, and in time."""

import itertools
import sys

import numpy as np
import pytest
from soft_sheets import sheet, slab, soft_slab, surface_on, tool

from asperity.contact.deformable import elements
from asperity.contact.deformable.box_mesh import box_tetrahedra
from asperity.contact.deformable.elastic_body import elastic_body, tetrahedra_in
from asperity.contact.deformable.elastic_contact import ElasticContact
from asperity.contact.deformable.linear_contact import agreeing_forces, yielding_stiffness
from asperity.contact.deformable.surface import DeformableSurface
from asperity.contact.deformable.surface_contact import SurfaceContact
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import mesh_from_arrays
from rough_maps import bumps

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
TIP = Body("tip", [Geom("sphere", (5e-3,))], bumps(5), "triplanar")


@pytest.fixture(scope="module")
def body():
    """Return a soft slab."""
    return soft_slab()


@pytest.fixture
def contact(body):
    """Return its contact with a rough tip, without friction."""
    return ElasticContact(body, surface_on(body.mesh, texture=bumps()), [TIP])


def beam(cells=(20, 3, 3), size=(0.1, 0.01, 0.01)):
    """Return a beam that is held at x = 0: mesh, nodes, tetrahedra."""
    import skfem
    import trimesh

    lines = (np.linspace(0.0, length, n + 1) for length, n in zip(size, cells, strict=True))
    grid = skfem.MeshTet.init_tensor(*lines)
    box = trimesh.creation.box(size).subdivide()
    box.apply_translation(0.5 * np.array(size))
    return mesh_from_arrays(box.vertices, box.faces), grid.p.T, grid.t.T


def test_a_cantilever_has_the_closed_forms():
    """Frequency of the first two bending modes, and compliance of the tip (Euler, Bernoulli)."""
    mesh, nodes, tetrahedra = beam()
    made = elastic_body(
        mesh, nodes, tetrahedra, modulus=1e6, density=1000.0, held=lambda p: p[:, 0] < 1e-9,
        poisson=0.3,
    )  # fmt: skip
    inertia, length = 0.01**4 / 12.0, 0.1
    first = 1.8751**2 / length**2 * np.sqrt(1e6 * inertia / (1000.0 * 1e-4))
    np.testing.assert_allclose(made.frequencies[:2], first, rtol=0.01)
    tip = 3 * np.flatnonzero(mesh.vertices[:, 0] > 0.1 - 1e-9) + 2
    bending = made.compliance[np.ix_(tip, tip)].mean()
    assert bending == pytest.approx(length**3 / (3.0 * 1e6 * inertia), rel=0.01)
    assert made.mass == pytest.approx(0.01, rel=1e-9)
    assert np.linalg.eigvalsh(made.residual).min() > -1e-9 * np.linalg.eigvalsh(made.compliance)[-1]


def _pole(fine, layers):
    """Return the lower part of a ball of 10 mm radius as nodes, tetrahedra and its lowest surface.

    Elements are finest round the pole, and only that part is a surface: nothing else is touched.
    """
    import skfem

    radius, half = 10e-3, 6e-3
    outer = np.array([0.32, 0.45, 0.7, 1.0]) * half
    x = np.concatenate([-outer[::-1], np.linspace(-1.4e-3, 1.4e-3, fine), outer])
    t = np.linspace(0.0, 1.0, layers)
    grid = skfem.MeshTet.init_tensor(x, x, 0.12 * t + 0.88 * t**2.5)
    nodes = grid.p.T.copy()
    held = nodes[:, 2] > 1.0 - 1e-9
    nodes[:, 2] = -np.sqrt(radius**2 - nodes[:, 0] ** 2 - nodes[:, 1] ** 2) * (1.0 - nodes[:, 2])
    fine_x = x[outer.size : -outer.size]
    u, v = np.meshgrid(fine_x, fine_x, indexing="ij")
    vertices = np.stack([u, v, -np.sqrt(radius**2 - u**2 - v**2)], axis=-1).reshape(-1, 3)
    i = np.arange(u.size).reshape(u.shape)
    a, b, c, d = (p.ravel() for p in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    faces = np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)])
    return nodes, grid.t.T, held, mesh_from_arrays(vertices, faces)


def _pressed_pole(fine, layers, depths):
    """Return force, contact radius and largest pressure of a soft ball on a plane, for depths."""
    nodes, tetrahedra, held, mesh = _pole(fine, layers)
    made = elastic_body(  # at rest it does not matter how many modes there are
        mesh, nodes, tetrahedra, modulus=1e5, density=1000.0, held=held, poisson=0.3, modes=2
    )
    layer = DeformableSurface(mesh, thickness=1e-4, modulus=2e5, poisson=0.0, pitch=6e-5)
    plane = Body("plane", [Geom("plane", (0.0, 0.0))])
    contact = ElasticContact(made, layer, [plane])
    for depth in depths:
        wrench = contact.settle([(0.0, 0.0, -10e-3 + depth, *UPRIGHT)])[0]
        radius = np.sqrt(contact.surface.contact_area / np.pi)
        pressure = contact.surface.pressure.max()
        yield depth - contact.surface.compression.max(), -wrench[2], radius, pressure


def _check_hertz(found, tolerance, of_approach):
    """Compare with Hertz, and the approach with that of a layer on a rigid base.

    The base is one radius above the pole: Dimitriadis et al., Biophysical J. 82, 2798 (2002),
    eq. 12, for a layer that sticks to it.
    """
    ball, nu = 10e-3, 0.3
    effective = 1e5 / (1.0 - nu**2)
    alpha = -(1.2876 - 1.4678 * nu + 1.3442 * nu**2) / (1.0 - nu)
    for depth, force, radius, pressure in found:
        hertz = (3.0 * force * ball / (4.0 * effective)) ** (1.0 / 3.0)
        assert radius == pytest.approx(hertz, rel=tolerance)
        assert pressure == pytest.approx(1.5 * force / (np.pi * hertz**2), rel=tolerance)
        chi = np.sqrt(ball * depth) / ball
        thin = 1.0 - 2.0 * alpha / np.pi * chi + 4.0 * alpha**2 / np.pi**2 * chi**2
        expected = 4.0 / 3.0 * effective * np.sqrt(ball) * depth**1.5 * thin
        assert force == pytest.approx(expected, rel=of_approach)


def test_a_soft_ball_on_a_plane_is_hertz():
    _check_hertz(_pressed_pole(15, 7, (1.3e-4,)), 0.05, 0.08)


@pytest.mark.slow
def test_a_finer_soft_ball_is_hertz_to_5_percent():
    _check_hertz(_pressed_pole(21, 9, (1e-4, 1.3e-4)), 0.02, 0.05)


def test_a_stiff_body_gives_the_rigid_wrench():
    stiff = soft_slab(modulus=1e13)
    surface = surface_on(stiff.mesh, texture=bumps())
    rigid = SurfaceContact(surface, [tool()])
    pose = (1e-3, -2e-3, 5.3e-3, *UPRIGHT)
    rigid.press(stiff.mesh.vertices, [pose])
    elastic = ElasticContact(stiff, surface, [tool()])
    largest = np.abs(rigid.wrenches).max()
    np.testing.assert_allclose(elastic.settle([pose]), rigid.wrenches, atol=1e-6 * largest)
    elastic.reset()
    for _ in range(3):
        found = elastic.step([pose], 1e-3)
    np.testing.assert_allclose(found, rigid.wrenches, atol=1e-6 * largest)


def test_at_rest_the_wrench_is_minus_the_gradient_of_all_energy(contact):
    pose = np.array([0.4e-3, 0.2e-3, 4.2e-3, *UPRIGHT])
    wrench = contact.settle([pose])[0]
    assert np.abs(contact.displacements).max() > 1e-4
    for axis in range(3):
        energies = []
        for h in (-2e-7, -1e-7, 1e-7, 2e-7):
            moved = pose.copy()
            moved[axis] += h
            contact.settle([moved])
            energies.append(contact.energy)
        slope = (8.0 * (energies[2] - energies[1]) - (energies[3] - energies[0])) / 12e-7
        assert -slope == pytest.approx(wrench[axis], abs=1e-5 * wrench[2])


def test_a_closed_path_returns_its_work(contact):
    """Round a circle that presses up to 1 mm in and slides over the texture: 1e-3 of the work."""
    work = moved = 0.0
    angles = np.linspace(0.0, 2.0 * np.pi, 241)
    places = np.stack(
        [
            1.5e-3 * np.sin(angles),
            1e-3 * np.sin(2 * angles),
            4.9e-3 - 1e-3 * np.sin(angles / 2) ** 2,
        ],
        axis=1,
    )
    last = contact.settle([(*places[0], *UPRIGHT)])[0, :3]
    for before, place in itertools.pairwise(places):
        force = contact.settle([(*place, *UPRIGHT)])[0, :3]
        step = 0.5 * (force + last) @ (place - before)
        work, moved, last = work + step, moved + abs(step), force
    assert abs(work) < 1e-3 * moved


def test_it_swings_with_its_frequency_and_damping(body):
    contact = ElasticContact(body, surface_on(body.mesh), [TIP], damping=0.02)
    contact.settle([(0.0, 0.0, 4e-3, *UPRIGHT)])
    stored = contact.energy - contact.surface.energy
    away, dt = (0.0, 0.0, 0.1, *UPRIGHT), 2e-5
    heights = []
    for _ in range(3000):
        contact.step([away], dt)
        heights.append(contact._q[0])
    crossings = np.flatnonzero(np.diff(np.sign(heights)))
    period = 2.0 * dt * np.diff(crossings).mean()
    assert period == pytest.approx(2.0 * np.pi / body.frequencies[0], rel=0.01)
    assert contact.energy + contact.kinetic_energy < 0.5 * stored


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_steps_come_to_rest_where_the_least_energy_is(body, friction):
    surface = surface_on(body.mesh, texture=bumps(), friction=friction)
    contact = ElasticContact(body, surface, [TIP], damping=0.7)
    pose = (0.2e-3, 0.1e-3, 4e-3, *UPRIGHT)
    for _ in range(1500):
        found = contact.step([pose], 1e-3)[0]
    settled = contact.settle([pose])[0]
    np.testing.assert_allclose(found, settled, atol=2e-3 * settled[2])
    assert contact.kinetic_energy < 1e-12


@pytest.mark.parametrize(("dt", "gain"), [(1e-3, 0.15), (1e-4, 0.03)])
def test_a_falling_tip_gains_no_energy_but_by_its_own_steps(body, dt, gain):
    """It meets the slab at 0.3 m/s. The gain is that of its explicit steps, and goes with them."""
    contact = ElasticContact(body, surface_on(body.mesh, texture=bumps(), friction=0.3), [TIP])
    height, speed, mass = 6e-3, -0.2, 0.02
    energies = []
    for _ in range(round(0.12 / dt)):
        force = contact.step([(0.0, 0.0, height, *UPRIGHT)], dt)[0, 2]
        speed += dt * (force / mass - 9.81)
        height += dt * speed
        kinetic = 0.5 * mass * speed**2 + mass * 9.81 * height
        energies.append(kinetic + contact.energy + contact.kinetic_energy)
    assert max(energies) < (1.0 + gain) * energies[0]
    assert height > -2e-3
    assert contact.error < 2e-5


def test_nothing_is_left_of_the_filling_of_a_mesh(tmp_path, monkeypatch):
    """By a stand-in for pytetwild, which leaves a file in the working folder."""
    mesh, nodes, tetrahedra = beam()

    class StandIn:
        @staticmethod
        def tetrahedralize(*_, **__):
            (tmp_path / "__tracked_surface.stl").write_text("left")
            return nodes, tetrahedra

    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "pytetwild", StandIn)
    tetrahedra_in(mesh, 6e-3)
    assert not list(tmp_path.iterdir())
    (tmp_path / "__tracked_surface.stl").write_text("mine")
    tetrahedra_in(mesh, 6e-3)
    assert len(list(tmp_path.iterdir())) == 1


def test_tetrahedra_fill_a_mesh():
    pytest.importorskip("pytetwild", reason="pip install 'asperity[soft]'", exc_type=ImportError)
    mesh, _, _ = beam()
    nodes, tetrahedra = tetrahedra_in(mesh, 6e-3)
    made = elastic_body(
        mesh, nodes, tetrahedra, modulus=1e6, density=1000.0, held=lambda p: p[:, 0] < 1e-4
    )
    assert made.mass == pytest.approx(0.01, rel=0.02)


def test_a_surface_between_the_nodes_moves_with_them():
    """Vertices within the elements are displaced as the elements are, quadratically."""
    nodes, tetrahedra = slab()
    given = {"modulus": 2e4, "density": 1e3, "held": nodes[:, 2] < -0.0119, "modes": 2}
    coarse = elastic_body(sheet(9), nodes, tetrahedra, **given)
    fine = elastic_body(sheet(17), nodes, tetrahedra, **given)
    middle = 3 * np.flatnonzero(~sheet(9).vertices.any(axis=1)) + 2
    other = 3 * np.flatnonzero(~sheet(17).vertices.any(axis=1)) + 2
    same = coarse.compliance[middle, middle]
    assert fine.compliance[other, other] == pytest.approx(same, rel=1e-6)


@pytest.mark.parametrize("quadratic", [False, True])
def test_an_even_strain_is_reproduced_exactly(quadratic):
    """The embedding of a surface gives an even strain to rounding, and its energy is exact."""
    nodes, tetrahedra, _ = box_tetrahedra((15e-3, 12e-3, 6e-3), (3, 4, 2))
    unknowns = elements.unknowns_of(tetrahedra, len(nodes), quadratic)
    mesh = sheet(6)
    onto = elements.embedding(mesh, nodes, tetrahedra, unknowns)
    corners = nodes[tetrahedra]
    pairs = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]
    middles = np.stack([corners[:, list(pair)].mean(axis=1) for pair in pairs], axis=1)
    at = np.concatenate([corners, middles], axis=1)[:, : unknowns.shape[1]]
    slope = np.array([[0.1, 0.02, 0.0], [0.03, -0.2, 0.1], [0.0, 0.05, 0.3]])
    values = np.empty(onto.shape[1])
    values[unknowns.ravel()] = (at @ slope.T).ravel()
    np.testing.assert_allclose((onto @ values).reshape(-1, 3), mesh.vertices @ slope.T, atol=1e-14)
    stiffness, mass = elements.stiffness_and_mass(nodes, tetrahedra, unknowns, (1e4, 0.3, 1e3))
    strain, volume = 0.5 * (slope + slope.T), 30e-3 * 24e-3 * 12e-3
    shear, dilation = 1e4 / 2.6, 1e4 * 0.3 / (1.3 * 0.4)
    energy = shear * (strain**2).sum() + 0.5 * dilation * np.trace(strain) ** 2
    assert 0.5 * values @ stiffness @ values == pytest.approx(energy * volume, rel=1e-12)
    moved = np.zeros_like(values)
    moved[0::3] = 1.0
    assert moved @ mass @ moved == pytest.approx(1e3 * volume, rel=1e-12)
    assert np.abs(stiffness @ moved).max() < 1e-12 * np.abs(stiffness).max()


@pytest.mark.parametrize("quadratic", [False, True])
def test_matrices_are_those_of_scikit_fem(quadratic):
    import skfem
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    nodes, tetrahedra = slab((2, 3, 2))
    nodes += 1e-4 * np.random.default_rng(0).normal(size=nodes.shape)
    edges = nodes[tetrahedra[:, 1:]] - nodes[tetrahedra[:, :1]]
    backwards = np.linalg.det(edges) < 0.0
    tetrahedra[backwards] = tetrahedra[backwards][:, [0, 2, 1, 3]]
    grid = skfem.MeshTet(np.ascontiguousarray(nodes.T), np.ascontiguousarray(tetrahedra.T))
    element = skfem.ElementTetP2() if quadratic else skfem.ElementTetP1()
    basis = skfem.Basis(grid, skfem.ElementVector(element))
    theirs = linear_elasticity(*lame_parameters(2e4, 0.4)).assemble(basis)
    unknowns = elements.unknowns_of(tetrahedra, len(nodes), quadratic)
    ours = elements.stiffness_and_mass(nodes, tetrahedra, unknowns, (2e4, 0.4, 1e3))[0]
    # Their unknowns have another order: eigenvalues do not.
    expected = np.linalg.eigvalsh(theirs.toarray())
    found = np.linalg.eigvalsh(ours.toarray())
    np.testing.assert_allclose(found, expected, atol=1e-12 * expected[-1])


def test_a_box_is_filled_with_tetrahedra_that_conform():
    half, counts = (0.03, 0.02, 0.01), (4, 3, 2)
    nodes, cells, faces = box_tetrahedra(half, counts)
    edges = nodes[cells[:, 1:]] - nodes[cells[:, :1]]
    volumes = np.linalg.det(edges) / 6.0
    assert volumes.min() > 0.0
    assert volumes.sum() == pytest.approx(8.0 * np.prod(half))
    corners = nodes[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert 0.5 * np.linalg.norm(across, axis=1).sum() == pytest.approx(0.0088)
    assert (np.einsum("ij,ij->i", across, corners.mean(axis=1)) > 0.0).all()
    used, corner = np.unique(faces, return_inverse=True)
    mesh = mesh_from_arrays(nodes[used], corner.reshape(-1, 3))
    assert not mesh.notes  # closed, wound alike, and nothing crosses
    assert len(faces) == 4 * (4 * 3 + 3 * 2 + 4 * 2)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_stiffness_is_the_change_of_the_wrench(body, friction):
    """At rest it is that of contact and body in series; with the body held, of the contact."""
    contact = ElasticContact(body, surface_on(body.mesh, friction=friction), [TIP])
    pose = np.array([0.4e-3, 0.2e-3, 4.2e-3, *UPRIGHT])
    contact.settle([pose])
    stiffness, damping = contact.derivatives()
    assert not damping.any()
    held = contact.surface.stiffness()
    assert np.linalg.eigvalsh(held - stiffness).min() > -1e-6 * held[2, 2]
    h, forces = 1e-6, []
    for sign in (1.0, -1.0):
        forces.append(contact.settle([pose + sign * np.array([0, 0, h, 0, 0, 0, 0])])[0, 2])
    # Normals that turn, and taxels that come into contact, are left out.
    assert stiffness[2, 2] == pytest.approx((forces[1] - forces[0]) / (2.0 * h), rel=0.05)


def test_the_stiffness_felt_is_that_of_whole_matrices():
    """The kernel against `R^T (I + K C)^-1 K R` over all vertices, and the forces that agree."""
    draw, v = np.random.default_rng(1), 9
    faces = np.array([[0, 4, 2], [2, 4, 7], [7, 4, 8]])
    springs = draw.normal(size=(3, 9, 9))
    springs = springs @ np.swapaxes(springs, 1, 2)
    compliance = draw.normal(size=(3 * v, 3 * v))
    compliance = 0.01 * compliance @ compliance.T
    arms = draw.normal(size=(v, 3))
    whole, rigid = np.zeros((3 * v, 3 * v)), np.zeros((3 * v, 6))
    for face, spring in zip(faces, springs, strict=True):
        rows = (3 * face[:, None] + np.arange(3)).ravel()
        whole[np.ix_(rows, rows)] += spring
    for k, arm in enumerate(arms):
        rigid[3 * k : 3 * k + 3, :3] = np.eye(3)
        for axis in range(3):
            rigid[3 * k : 3 * k + 3, 3 + axis] = np.cross(np.eye(3)[axis], arm)
    felt = rigid.T @ np.linalg.solve(np.eye(3 * v) + whole @ compliance, whole @ rigid)
    out = np.empty((6, 6))
    yielding_stiffness(faces, springs, compliance, arms, out)
    np.testing.assert_allclose(out, felt, atol=1e-10 * np.abs(felt).max())
    free, place, force = draw.normal(size=(3, 3 * v))
    used = np.unique(faces)
    pushed = np.repeat(np.isin(np.arange(v), used), 3)
    force[~pushed] = 0.0
    right = force - whole @ (free - place)
    agreeing = np.linalg.solve(np.eye(3 * v) + whole @ compliance, right)
    found = np.empty(3 * v)
    agreeing_forces(faces, springs, compliance, free, place, force, found)
    np.testing.assert_allclose(found, agreeing, atol=1e-10 * np.abs(agreeing).max())


def test_damping_is_the_friction_that_the_body_passes_on(body):
    contact = ElasticContact(body, surface_on(body.mesh, friction=0.5), [TIP])
    pose = np.array([0.4e-3, 0.2e-3, 4.2e-3, *UPRIGHT])
    contact.settle([pose])
    contact.step([pose], 1e-3)
    stiffness, damping = contact.derivatives()
    for matrix in (stiffness, damping):
        np.testing.assert_allclose(matrix, matrix.T, atol=1e-9 * np.abs(matrix).max())
        assert np.linalg.eigvalsh(matrix).min() > -1e-9 * np.abs(matrix).max()
    # At rest all friction is viscous, and hardly slower than the body yields.
    viscous = contact.surface.out.damping
    assert 0.0 < damping[0, 0] < viscous[0, 0]
