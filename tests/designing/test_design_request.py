"""From a request to a folder."""

import json

import numpy as np
import pytest
import tifffile

import asperity
from asperity.cli import main
from asperity.designing.target_file import read_request
from asperity.errors import AsperityError
from asperity.runs.run_scene import run_scene
from asperity.scene.builtin.probe_plate import probe_plate

SURFACE = {"pattern": "sinusoid", "wavelength": 2e-3, "free": {"amplitude": [5e-6, 2e-4]}}
QUICK = {"strokes": 1, "starts": 1, "candidates": 1}


def _request(**target):
    return {"target": target, "surface": SURFACE, "search": QUICK}


def test_a_design_leaves_map_plate_scene_and_report(tmp_path):
    table = _request(value=1.5) | {"plate": {"size": [0.01, 0.01]}}
    made = asperity.design(table, tmp_path / "d", six_dof=False)
    [surface] = made.surfaces
    assert surface.worst < 0.02
    folder = tmp_path / "d"
    report = json.loads((folder / "design.json").read_text("utf-8"))
    assert report["surfaces"][0]["targets"][0]["wanted"] == 1.5
    assert (folder / "report.html").stat().st_size > 10_000
    stored = tifffile.imread(folder / "1" / "heights.tiff")
    assert stored.dtype == np.float32
    assert np.allclose(
        stored[::-1], surface.tile.to_make.samples - surface.tile.to_make.lowest, atol=1e-9
    )
    for name in ("plate.stl", "base.obj", "made.tiff", "look.png"):
        assert list(folder.rglob(name))
    scene = asperity.load_scene(str(folder / "1"))
    assert scene.motion.speed == pytest.approx(0.083)


@pytest.mark.slow
def test_six_dof_agrees_with_the_design(tmp_path):
    table = {
        "target": {"value": 1.2},
        "surface": {"pattern": "jittered_dots"},
        "search": {"candidates": 1},
        "process": {"preset": "sla"},
        "plate": {"size": [0.01, 0.01]},
    }
    made = asperity.design(table, tmp_path / "d")
    for check in made.report["surfaces"][0]["six_dof"]:
        assert abs(check["difference"]) < 0.05


def test_command_refuses_what_cannot_be_had(tmp_path, capsys):
    file = tmp_path / "t.toml"
    file.write_text(
        "[target]\nvalue = 50.0\n[[surface]]\npattern = 'sinusoid'\nwavelength = 2e-3\n"
        "[search]\nstrokes = 1\nstarts = 1\n",
        "utf-8",
    )
    assert main(["design", str(file), "--out", str(tmp_path / "d")]) == 2
    assert "the nearest has" in capsys.readouterr().err
    assert not (tmp_path / "d").exists()


def test_like_another_surface_but_rougher():
    like = {"kind": "sinusoid", "wavelength": 2e-3, "amplitude": 5e-5}
    same = read_request(_request(kind="surface", like=like)).demands
    rougher = read_request(_request(kind="surface", like=like, jnd=2, weber_fraction=0.2)).demands
    assert rougher[0].value == pytest.approx(1.44 * same[0].value)


def test_a_spectrum_is_demanded_band_by_band():
    request = read_request(
        _request(kind="spectrum", frequencies=[40.0, 80.0], levels=[1.0, 0.5], speed=0.1)
    )
    assert [demand.value for demand in request.demands] == [1.0, 0.5]
    low, high = request.demands[1].measure.band
    assert low * high == pytest.approx(80.0**2)


def test_a_recorded_surface_is_found_again(tmp_path):
    """The tip of 3 mm slides over waves of 2 mm, 0.1 mm high; the scene's own hand is stiff."""
    run_scene(probe_plate(), tmp_path / "recording.h5")
    table = {
        "target": {"kind": "recording", "file": str(tmp_path / "recording.h5")},
        "surface": {"pattern": "sinusoid"}, "search": {"strokes": 1, "candidates": 1},
        "plate": {"size": [0.01, 0.01]},
    }  # fmt: skip
    made = asperity.design(table, tmp_path / "d", six_dof=False)
    [surface] = made.surfaces
    assert surface.worst < 0.25
    assert surface.parameters["wavelength"] == pytest.approx(2e-3, rel=0.05)
    assert surface.parameters["amplitude"] == pytest.approx(1e-4, rel=0.25)
    # Waves pass at 41.5 Hz: what lies between that and its double is no target.
    middles = [np.sqrt(np.prod(demand.measure.band)) for demand in surface.demands]
    assert any(37.0 < middle < 47.0 for middle in middles)
    assert not any(90.0 < middle < 110.0 for middle in middles)
    assert "third octaves" in (tmp_path / "d" / "report.html").read_text("utf-8")


def test_lists_go_together():
    request = read_request(_request(value=[1.0, 1.2], speed=[0.04, 0.08], force=0.5))
    assert [(d.value, d.speed, d.force) for d in request.demands] == [
        (1.0, 0.04, 0.5), (1.2, 0.08, 0.5),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({}, "needs a table"),
        (_request(value=[1.0, 2.0], speed=[0.04, 0.08, 0.1]), "one length"),
        (_request(valu=1.0), "did you mean 'value'"),
        (_request(value=-1.0), "value must be"),
        (_request(kind="metrics"), "did you mean 'metric'"),
        (_request(kind="series", first=3.0, last=1.0, steps=7), "must rise"),
        (_request(kind="series", first=1.0, last=3.0, steps=2), "steps"),
        (_request(kind="surface"), "like"),
        (_request(kind="recording"), "file"),
        (_request(value=1.0) | {"process": {"preset": "slaa"}}, "did you mean 'sla'"),
        (_request(value=1.0) | {"hand": {"mas": 1.0}}, "did you mean 'mass'"),
        ({"target": {"value": 1.0}, "surface": {"pattern": "free", "samples": 8}}, "samples"),
    ],
)
def test_bad_requests_are_refused(table, message):
    with pytest.raises(AsperityError, match=message):
        read_request(table)


def test_a_curve_over_spacing_makes_a_surface_for_each(tmp_path):
    table = {
        "target": {"value": [1.2, 1.3], "spacing": [1.8e-3, 2.2e-3]},
        "surface": {"pattern": "sinusoid", "wavelength": 2e-3,
                    "free": {"amplitude": [5e-6, 2e-4]}},
        "search": QUICK | {"accept": "nearest"},
        "plate": {"size": [0.01, 0.01]},
    }  # fmt: skip
    made = asperity.design(table, tmp_path / "d", six_dof=False)
    assert set(made.surfaces[0].tiles) == {1.8e-3, 2.2e-3}
    assert (tmp_path / "d" / "1.2" / "plate.stl").is_file()
