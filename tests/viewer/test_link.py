"""A link reproduces scene and settings, asks first, and opens no file."""

import json
from types import SimpleNamespace
from urllib.parse import parse_qs, urlencode

import pytest

from asperity.errors import AsperityError
from asperity.realtime.servo.parameters import LiveParameters
from asperity.scene.builtin import load_scene
from asperity.viewer.change_history import ChangeHistory, State, changed_parameters
from asperity.viewer.changes import SURFACES, on_coupling, with_texture
from asperity.viewer.link import LinkRequests, linked, query_of, scene_as_felt
from asperity.viewer.session_config import SessionConfig


@pytest.fixture
def config():
    return SessionConfig(on_coupling(load_scene("probe-plate")), "probe-plate")


def parameters_of(config):
    return LiveParameters.of(config.scene, config.rate)


def test_a_link_brings_back_texture_friction_and_stiffness(config):
    knurled = with_texture(config, "plate", "knurl", relief=2e-4)
    now = LiveParameters(
        500.0, 12345.0, 0.37, parameters_of(knurled).coupling
    )  # fmt: skip
    back = linked(config, query_of(knurled, now))
    again = parameters_of(back)
    assert (again.rate, again.stiffness, again.friction) == (500.0, 12345.0, 0.37)
    plate = next(b for b in back.scene.bodies if b.name == "plate")
    assert plate.texture.relief == pytest.approx(2e-4, rel=1e-3)


@pytest.mark.parametrize(
    ("query", "word"),
    [
        ({"scene": "/etc"}, "no built-in scene"),
        ({"scene": "probe-plate", "settings": "{"}, "damaged"),
        ({"scene": "probe-plate", "rate": "fast"}, "damaged"),
        (
            {"scene": "probe-plate",
             "settings": json.dumps({"bodies": {"plate": {"texture": {"file": "/etc/hosts"}}}})},
            "files",
        ),
    ],
)  # fmt: skip
def test_a_link_that_is_wrong_or_names_files_is_refused(config, query, word):
    with pytest.raises(AsperityError, match=word):
        linked(config, urlencode(query))


def test_opening_a_link_only_notes_it_and_once():
    links = LinkRequests()
    refused = links.watching(lambda *_: "403")
    refused(None, SimpleNamespace(path="/?scene=probe-plate"))
    assert links.take() == ""
    watched = links.watching(lambda *_: None)
    assert watched(None, SimpleNamespace(path="/?scene=file-cad")) is None
    watched(None, SimpleNamespace(path="/"))
    assert parse_qs(links.take()) == {"scene": ["file-cad"]}
    assert links.take() == ""


def test_a_saved_scene_has_the_present_settings(config, tmp_path):
    now = LiveParameters(1000.0, 23456.0, 0.21, parameters_of(config).coupling)
    scene_as_felt(config, now).save(tmp_path / "saved")
    back = load_scene(str(tmp_path / "saved"))
    assert back.acting_force.stiffness == pytest.approx(23456.0)
    assert back.acting_force.friction == pytest.approx(0.21)


def test_a_drag_of_a_slider_is_undone_as_one_change(config):
    history, own = ChangeHistory(), parameters_of(config)
    for i in range(20):
        history.note(State("friction", config, own), 0.1 * i)
    history.note(State("friction", config, own), 10.0)
    assert len(history) == 2
    history.pop()
    history.pop()
    with pytest.raises(AsperityError, match="nothing to undo"):
        history.pop()
    assert changed_parameters(own, own) == {}


@pytest.mark.parametrize("name", SURFACES)
def test_every_preset_is_a_texture_that_can_be_felt(config, name):
    made = with_texture(config, "plate", SURFACES[name])
    field = next(b for b in made.scene.bodies if b.name == "plate").texture
    assert 2e-6 < field.relief < 1e-3


def test_coarser_sandpaper_is_higher(config):
    reliefs = [
        next(
            b for b in with_texture(config, "plate", SURFACES[f"sandpaper {p}"]).scene.bodies
            if b.name == "plate"
        ).texture.relief
        for p in ("P40", "P60", "P80", "P120", "P180", "P240")
    ]  # fmt: skip
    assert reliefs == sorted(reliefs, reverse=True)
