"""What a page may change of a scene."""

import numpy as np
import pytest
import trimesh

from asperity.contact.response.settings import LAWS
from asperity.errors import AsperityError
from asperity.scene.builtin import load_scene
from asperity.scene.texture import body_texture
from asperity.texture.patterns.patterns import EXAMPLES
from asperity.viewer.changes import (
    METHODS,
    SMOOTH,
    methods_for,
    on_coupling,
    scaled_texture,
    texture_of,
    with_device,
    with_meshes,
    with_method,
    with_scene,
    with_texture,
)
from asperity.viewer.drawables.shapes import shapes_of
from asperity.viewer.session_config import SessionConfig


@pytest.fixture(scope="module")
def plate():
    return SessionConfig(on_coupling(load_scene("probe-plate")), "probe-plate")


def field_of(table):
    return body_texture(table, "texture", None)[0]


@pytest.mark.parametrize("kind", EXAMPLES)
def test_any_texture_is_made_as_high_and_as_wide_as_wanted(kind):
    table = {"kind": kind, **EXAMPLES[kind]}
    plain = field_of(table)
    made = field_of(scaled_texture(table, relief=1.3e-4, pixel_size=1.5 * plain.pixel_size[0]))
    assert made.relief == pytest.approx(1.3e-4, rel=1e-6)
    np.testing.assert_allclose(made.pixel_size, 1.5 * np.array(plain.pixel_size))
    assert made.samples.shape == plain.samples.shape


@pytest.mark.parametrize("kind", ["jittered_dots", "cross_cut"])
def test_what_is_shown_keeps_to_its_triangles(plate, kind):
    shapes = shapes_of(with_texture(plate, "plate", kind).scene, 20_000)
    assert 10_000 < sum(len(shape.faces) for shape in shapes) <= 20_000


def test_a_file_of_heights_keeps_what_it_says_unless_overridden(tmp_path):
    ticks = np.sin(np.arange(64) / 5.0)[:, None] * np.ones(64) * 1e-5
    np.save(tmp_path / "h.npy", ticks)
    table = {"file": str(tmp_path / "h.npy"), "pixel_size": 1e-5, "border": "wrap"}
    made = field_of(scaled_texture(table, relief=5e-5, pixel_size=2e-5))
    assert made.relief == pytest.approx(5e-5)
    assert made.pixel_size[0] == pytest.approx(2e-5)


def test_a_body_gets_another_texture_and_keeps_the_rest(plate):
    made = with_texture(plate, "plate", "jittered_dots", relief=3e-4)
    assert texture_of(made.scene, "plate").relief == pytest.approx(3e-4)
    assert made.scene.coupling == plate.scene.coupling
    assert made.scene.xml == plate.scene.xml
    table = made.scene.document["bodies"]["plate"]["texture"]
    assert "wavelength" not in table  # of the sinusoid there was
    smooth = with_texture(made, "plate", SMOOTH)
    assert texture_of(smooth.scene, "plate") is None
    assert texture_of(with_texture(smooth, "probe", "sinusoid").scene, "probe") is not None


@pytest.mark.parametrize(
    ("call", "why"),
    [
        (lambda c: with_texture(c, "plte", "knurl"), "unknown body 'plte' .did you mean 'plate'"),
        (lambda c: with_texture(c, "plate", "nurl"), "unknown texture 'nurl'"),
        (lambda c: with_texture(c, "plate", "knurl", relief=1.0), "relief must lie between"),
        (lambda c: with_texture(c, "plate", "knurl", pixel_size=0.0), "pixel size must lie"),
        (lambda c: with_texture(c, "probe", "as it is"), "probe is smooth"),
        (lambda c: with_method(c, "Newton"), "unknown force law"),
        (lambda c: with_device(c, "spoon"), "unknown device 'spoon'"),
        (lambda c: with_scene(c, "prob-plate"), "no scene 'prob-plate'"),
    ],
)
def test_bad_wishes_are_refused_in_one_line(plate, call, why):
    with pytest.raises(AsperityError, match=why):
        call(plate)


def test_laws_are_named_and_meshes_have_one(plate):
    made = with_method(plate, "Siira & Pai 1996")
    assert made.scene.force.law == "siira-pai"
    soft = with_method(plate, "Otaduy & Lin, soft maximum", softness=5e-6)
    assert (soft.scene.force.gradient, soft.scene.force.softness) == ("soft", 5e-6)
    assert methods_for(plate.scene) == list(METHODS)
    assert {method["law"] for method in METHODS.values()} == set(LAWS)
    made = with_meshes(plate, {"kind": "block"}, {"kind": "cad_part"})
    assert methods_for(made.scene) == list(METHODS)[:1]
    assert made.scene.coupling.mode == "implicit"
    with pytest.raises(AsperityError, match="unknown force law"):
        with_method(made, "Minsky 1995")


def test_a_file_is_in_the_unit_that_it_states_else_in_mm(plate, tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.01)
    ball.export(tmp_path / "metres.glb")
    ball.apply_scale(1e3)
    ball.export(tmp_path / "mm.stl")
    files = [{"file": str(tmp_path / name)} for name in ("metres.glb", "mm.stl")]
    made = with_meshes(plate, *files).scene
    for body in made.bodies:
        extent = np.ptp(body.mesh.vertices, axis=0).max()
        assert extent == pytest.approx(0.02, rel=1e-3), body.name
    made = with_meshes(plate, *(files[:1] * 2), unit="cm").scene
    assert np.ptp(made.bodies[0].mesh.vertices, axis=0).max() == pytest.approx(2e-4, rel=1e-3)
