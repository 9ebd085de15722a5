"""`asperity fit`, as it is called: from a scene's runs to a model that is judged and kept."""

import json

import numpy as np
import pytest

from asperity.cli import main
from asperity.cli.result import set_json
from asperity.runs.run_scene import run_scene
from asperity.scene.builtin import load_scene
from asperity.scene.trajectory import ScriptedMotion
from asperity.vibrotactile.harmonic import HarmonicModel
from asperity.vibrotactile.hatt import read_hatt
from asperity.vibrotactile.model_file import read_model


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Return three slides over probe-plate-dots, at three speeds and forces, 1 kHz."""
    folder = tmp_path_factory.mktemp("runs")
    scene = load_scene("probe-plate-dots").changed(force={"anti_alias": "off"})
    paths = []
    for i, (speed, force) in enumerate(((0.04, 0.4), (0.08, 0.4), (0.06, 1.0))):
        place = folder / f"{i}.h5"
        motion = ScriptedMotion(speed=speed, press_force=force, seconds=1.2, length=0.05)
        run_scene(scene, place, motion=motion)
        paths.append(place)
    return paths


def test_a_model_of_recordings_matches_their_held_out_ends(recordings, tmp_path, capsys):
    out = tmp_path / "fit"
    assert main(["fit", *map(str, recordings), "--out", str(out), "--wav"]) == 0
    said = capsys.readouterr().out
    told = json.loads((out / "fit.json").read_text())
    assert sorted(told["files"]) == sorted(path.name for path in out.glob("[!.]*"))
    assert told["rate_hz"] == pytest.approx(1000.0)
    assert len(told["held_out"]) >= 3
    # The distance that docs/vibration.md states, and better than noise of the right size.
    assert told["median"]["match"]["fit"] > 0.85
    assert told["median"]["match"]["itakura_saito"] < 0.5
    assert told["median"]["match"]["fit"] > told["median"]["noise"]["fit"] + 0.1
    assert f"fit {told['median']['match']['fit']:.3f}" in said
    assert isinstance(read_model(out / "model.json"), HarmonicModel)
    assert told["kind"] == "harmonic"
    assert "model.xml: HaTT's format has no periods" in said or not told["periods_m"]
    model = read_hatt(out / "model.xml")
    assert model.order == told["order"]
    for speed, force in np.random.default_rng(0).uniform(0.0, (0.1, 1.2), (50, 2)):
        assert np.abs(np.roots(model.filter_at(speed, force).ar)).max() < 1.0
    # The model in the file is judged as the one that was fitted.
    for name, kind in (("model.xml", "noise"), ("model.json", "harmonic")):
        again = tmp_path / name
        options = ["--model", str(out / name), "--out", str(again)]
        assert main(["fit", str(recordings[0]), *options]) == 0
        judged = json.loads((again / "fit.json").read_text())
        assert "fitted" not in judged
        assert judged["kind"] == kind


def test_noise_alone_can_be_chosen(recordings, tmp_path, capsys):
    out = tmp_path / "fit"
    words = ["fit", *map(str, recordings), "--kind", "noise", "--out", str(out)]
    assert main([*words, "--json"]) == 0
    set_json(False)
    printed = json.loads(capsys.readouterr().out)
    assert printed["kind"] == "noise"
    assert printed["out"] == str(out)
    assert json.loads((out / "fit.json").read_text())["model_xml_loses"] == []
    assert not isinstance(read_model(out / "model.json"), HarmonicModel)


def test_a_model_is_not_judged_by_what_it_is_made_of(recordings, tmp_path, capsys):
    options = ["--held-out", str(recordings[1]), "--out", str(tmp_path / "fit")]
    assert main(["fit", *map(str, recordings[:2]), *options]) == 2
    assert "--held-out 1.h5 is also a SOURCE; give another" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "give a scene"),
        (["nowhere.h5"], "no such recording: nowhere.h5"),
        (["probe-plate", "hammer-blocks"], "one scene, or recordings"),
        (["probe-plate", "--held-out", "x.h5"], "--held-out needs recordings as SOURCE"),
        (["x.h5", "--seconds", "2"], "--seconds needs a scene as SOURCE"),
        (["probe-plate", "--criterion", "best"], "unknown --criterion 'best'"),
        (["probe-plate", "--kind", "sines"], "unknown --kind 'sines'"),
        (["probe-plate", "--forces-n", "400"], "--forces-n must lie between"),
        (["probe-plate", "--model", "none.xml"], "no such texture model"),
    ],
)
def test_what_is_wrong_is_one_line_and_leaves_nothing(arguments, told, tmp_path, capsys):
    assert main(["fit", *arguments, "--out", str(tmp_path / "fit")]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
