"""`asperity bake`: a scan in, a folder out that `asperity run` takes."""

import json

import numpy as np
import trimesh
from PIL import Image

from asperity.cli import main


def _stone(path):
    ball = trimesh.creation.icosphere(subdivisions=4, radius=15.0)
    points = np.asarray(ball.vertices) * [1.0, 0.9, 0.6]
    points *= 1.0 + 0.004 * np.sin(points @ [1.1, 0.7, 0.5])[:, None]
    trimesh.Trimesh(points, ball.faces, process=False).export(path)
    return str(path)


def test_a_scan_is_baked_and_run(tmp_path, capsys):
    stone, out = _stone(tmp_path / "stone.stl"), tmp_path / "stone"
    arguments = ["bake", stone, "--faces", "150", "--size", "128", "--out", str(out)]
    assert main(arguments) == 0
    said = capsys.readouterr()
    assert "5,120 triangles reduced to 150 and 128 x 128 heights" in said.out
    assert "unit guessed: mm" in said.out
    assert said.err == ""
    report = json.loads((out / "bake.json").read_text("utf-8"))
    assert report["faces"] == 150
    assert report["error_um"]["rms"] < 20.0
    with Image.open(out / "picture.png") as picture:
        assert min(picture.size) > 800
        assert len(np.unique(np.asarray(picture.convert("L")))) > 100
    assert main(arguments) == 2
    assert "not empty; give --overwrite" in capsys.readouterr().err
    run = ["run", str(out), "--seconds", "0.05", "--out", str(tmp_path / "run")]
    assert main(run) == 0
    summary = json.loads((tmp_path / "run" / "summary.json").read_text("utf-8"))
    assert summary["contacts"]["ticks_in_contact"] == summary["ticks"] == 51
    assert 0.1 < summary["largest_force_n"] < 1.0


def test_bad_input_is_one_line(tmp_path, capsys):
    stone, out = _stone(tmp_path / "stone.stl"), ["--out", str(tmp_path / "out")]
    for options, told in (
        (["--faces", "2"], "faces must be a whole number from 4"),
        (["--size", "7"], "size must lie between 32 and 8192"),
        (["--unit", "ell"], "unknown unit 'ell'"),
        (["--pixel-um", "-1"], "--pixel-um"),
    ):
        assert main(["bake", stone, *options, *out]) == 2
        said = capsys.readouterr().err
        assert told in said
        assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()
