"""Wrong input of deformable surfaces and elastic bodies gets one clear line, and no force."""

import numpy as np
import pytest
from soft_sheets import sheet, slab, soft_slab, surface_on

from asperity.contact.deformable.elastic_body import elastic_body
from asperity.contact.deformable.elastic_contact import ElasticContact
from asperity.contact.deformable.surface_contact import SurfaceContact
from asperity.contact.multibody import MultibodySolver
from asperity.contact.soft.skin import SoftSkin
from asperity.contact.soft.skin_contact import SkinContact
from asperity.contact.solver import ContactSolver
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom
from asperity.scene.builtin import load_scene

BALL = Body("ball", [Geom("sphere", (5e-3,))])
ABOVE = (0.0, 0.0, 4.8e-3, 1.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"modulus": -1.0}, "modulus must"),
        ({"poisson": 0.5}, "poisson must be 0 or above and below 0.5"),
        ({"thickness": 0.0}, "thickness must"),
        ({"pitch": 1e-6}, "a pitch of .* m or more"),
        ({"friction": -0.1}, "friction must"),
    ],
)
def test_options_of_a_surface(options, words):
    with pytest.raises(AsperityError, match=words) as caught:
        _ = surface_on(sheet(5), **options).arrays
    assert "\n" not in str(caught.value)


def test_vertices():
    flat = sheet(5)
    contact = SurfaceContact(surface_on(flat), [BALL], leap=1e-3)
    contact.press(flat.vertices, [ABOVE])
    assert contact.wrenches[0][2] > 0.0
    wrong = {
        "must have the shape": flat.vertices[:-1],
        "row 3 is": np.where(np.arange(25)[:, None] == 3, np.nan, flat.vertices),
        "vertex 7 leaps by 0.002": flat.vertices + (np.arange(25) == 7)[:, None] * [0, 0, 2e-3],
    }
    for words, vertices in wrong.items():
        contact.press(flat.vertices, [ABOVE])
        with pytest.raises(AsperityError, match=words):
            contact.press(vertices, [ABOVE])
        assert not contact.wrenches.any()
        assert not contact.forces.any()
    with pytest.raises(AsperityError, match="1 bodies, but 2 poses"):
        contact.press(flat.vertices, [ABOVE, ABOVE])
    contact.press(flat.vertices, [ABOVE])
    assert contact.wrenches[0][2] > 0.0


def test_a_collapsed_triangle():
    flat = sheet(5)
    contact = SurfaceContact(surface_on(flat), [BALL])
    squeezed = flat.vertices * (1e-5, 1.0, 1.0)
    with pytest.raises(AsperityError, match="has collapsed"):
        contact.press(squeezed, [ABOVE])
    assert not contact.forces.any()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"modulus": -5.0}, "modulus must"),
        ({"density": 0.0}, "density must"),
        ({"poisson": 0.5}, "poisson must be .* below 0.5"),
        ({"modes": 0}, "modes must be"),
        ({"held": lambda p: p[:, 2] > 1.0}, "0 nodes are held"),
        ({"held": [True]}, "held must be"),
    ],
)
def test_options_of_an_elastic_body(options, words):
    nodes, tetrahedra = slab((2, 2, 1))
    given = {"modulus": 1e4, "density": 1e3, "held": lambda p: p[:, 2] < -0.011} | options
    with pytest.raises(AsperityError, match=words):
        elastic_body(sheet(3), nodes, tetrahedra, **given)


def test_elements():
    nodes, tetrahedra = slab((2, 2, 1))
    given = {"modulus": 1e4, "density": 1e3, "held": lambda p: p[:, 2] < -0.011}
    flat = nodes.copy()
    flat[tetrahedra[5]] = flat[tetrahedra[5]].mean(axis=0) * (1.0, 1.0, 0.0) + 1e-9
    with pytest.raises(AsperityError, match="is flat"):
        elastic_body(sheet(3), flat, tetrahedra, **given)
    inside_out = nodes.copy()
    inside_out[np.flatnonzero(nodes[:, 2] == 0.0)[4], 2] = -0.03  # through the base
    with pytest.raises(AsperityError, match="is inverted"):
        elastic_body(sheet(3), inside_out, tetrahedra, **given)
    with pytest.raises(AsperityError, match="valid: 0 to"):
        elastic_body(sheet(3), nodes, tetrahedra + 100, **given)
    with pytest.raises(AsperityError, match="belong to no tetrahedron"):
        elastic_body(sheet(3), np.concatenate([nodes, [[1.0, 1.0, 1.0]]]), tetrahedra, **given)
    far = sheet(3, half=0.5)
    with pytest.raises(AsperityError, match="farther from all tetrahedra"):
        elastic_body(far, nodes, tetrahedra, **given)


def test_steps():
    body = soft_slab()
    contact = ElasticContact(body, surface_on(body.mesh), [BALL])
    for dt in (0.0, -1e-3, 0.5, np.nan):
        with pytest.raises(AsperityError, match="dt must"):
            contact.step([ABOVE], dt)
    contact = ElasticContact(body, surface_on(body.mesh), [BALL], leap=1e-4)
    contact.step([(0.0, 0.0, 4.97e-3, 1.0, 0.0, 0.0, 0.0)], 1e-3)
    assert contact.surface.wrenches.any()
    with pytest.raises(AsperityError, match=r"vertex \d+ would leap by .* at most 0.0001 m"):
        contact.step([(0.0, 0.0, 2e-3, 1.0, 0.0, 0.0, 0.0)], 1e-3)
    assert not contact.surface.wrenches.any()
    assert not contact.displacements.any()


def test_two_soft_bodies_are_refused_in_one_line():
    """In scenes: `tests/scene/test_elastic_table.py`; of flexes a note tells it."""
    scene, finger = load_scene("elastic-block"), load_scene("finger-plate").skin
    solid, body = scene.elastic, soft_slab()
    surface = surface_on(body.mesh)
    pad = SoftSkin(Body("pad", [Geom("sphere", (5e-3,))]), 1e-3, 1e4)
    for make in (
        lambda: SurfaceContact(surface, [surface]),
        lambda: SurfaceContact(surface, surface),
        lambda: ElasticContact(body, surface, [body]),
        lambda: solid.contact([pad]),
        lambda: SkinContact(pad, [surface]),
        lambda: SkinContact(pad, [finger]),
        lambda: ContactSolver(scene.model, [solid, *scene.bodies], scene.tool),
        lambda: MultibodySolver(scene.model, [pad, *scene.bodies]),
    ):
        with pytest.raises(AsperityError, match="rigid") as refused:
            make()
        assert "\n" not in str(refused.value)
        assert "Body" in str(refused.value)
