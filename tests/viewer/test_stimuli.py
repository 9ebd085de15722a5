"""A series of stimuli beside a scene, and the slider along it."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from asperity.designing.candidate import designed_tile
from asperity.designing.forward import Demand
from asperity.designing.measures import VibrationMeasure
from asperity.designing.process import process_of
from asperity.designing.surface_folder import write_map, write_probe_scene
from asperity.scene.builtin import load_scene
from asperity.texture.patterns.patterns import sinusoid
from asperity.viewer.changes import with_texture
from asperity.viewer.panels.stimuli import BODY, series_of
from asperity.viewer.session_config import SessionConfig


@pytest.fixture(scope="module")
def series(tmp_path_factory):
    whole = tmp_path_factory.mktemp("series")
    demand = Demand(VibrationMeasure(), 1.0)
    for i in range(3):
        folder = whole / str(i + 1)
        folder.mkdir()
        field = sinusoid(wavelength=2e-3, amplitude=(i + 1) * 4e-5, periods=4, samples=32)
        made = designed_tile(np.array(field.samples), 2e-3 / 32, process_of("none")).made
        write_map(made, folder / "made.tiff")
        write_probe_scene(made, demand, folder)
    (whole / "design.json").write_text(json.dumps({"kind": "series", "surfaces": [{}] * 3}))
    return whole


def test_a_scene_knows_its_series_and_its_place(series):
    textures, place = series_of(load_scene(str(series / "2")))
    assert (len(textures), place) == (3, 1)


def test_the_textures_of_the_series_can_be_shown(series):
    scene = load_scene(str(series / "1"))
    textures, _ = series_of(scene)
    config = SessionConfig(scene=scene)
    reliefs = []
    for i, texture in enumerate(textures):
        shown = with_texture(config, BODY, texture)
        assert series_of(shown.scene)[1] == i
        reliefs.append(next(b for b in shown.scene.bodies if b.name == BODY).texture.relief)
    assert reliefs == pytest.approx([8e-5, 1.6e-4, 2.4e-4], rel=1e-2)


def test_other_scenes_are_of_no_series(series, tmp_path):
    assert series_of(load_scene("probe-plate")) == ([], 0)
    load_scene("probe-plate").save(tmp_path / "s")
    assert series_of(load_scene(str(tmp_path / "s"))) == ([], 0)
    (tmp_path / "design.json").write_text("[1]")
    assert series_of(load_scene(str(tmp_path / "s"))) == ([], 0)
    (tmp_path / "design.json").write_text('{"kind": "series", "surfaces": [{}, {}]}')
    assert series_of(load_scene(str(tmp_path / "s"))) == ([], 0)


def test_the_slider_changes_the_texture(series, monkeypatch):
    from asperity.viewer.panels import stimuli

    monkeypatch.setattr(stimuli, "from_browser", lambda event: True)
    monkeypatch.setattr(stimuli, "attempt", lambda event, what, change: change())
    restarted = []

    def restart(config):
        restarted.append(config)
        return SimpleNamespace(result=lambda: None)

    panel = stimuli.StimuliPanel()
    panel._servo = SimpleNamespace(
        config=SessionConfig(scene=load_scene(str(series / "1"))), restart=restart
    )
    panel._folder = SimpleNamespace(visible=None)
    panel._slider = SimpleNamespace(value=1, max=2)
    panel._show()
    assert (panel._folder.visible, panel._slider.max) == (True, 3)
    panel._slider.value = 3
    panel._moved(SimpleNamespace())
    [config] = restarted
    assert series_of(config.scene)[1] == 2
