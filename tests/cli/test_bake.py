"""`asperity bake`: a scan in, a folder out that `asperity run` takes."""

import json

import numpy as np
import pytest
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
    # The same again replaces its own, but nothing that was added.
    (out / "notes.txt").write_text("mine")
    assert main(arguments) == 2
    assert "notes.txt in it was not written by asperity" in capsys.readouterr().err
    (out / "notes.txt").unlink()
    assert main([*arguments, "--no-picture"]) == 0
    assert not (out / "picture.png").exists()
    run = ["run", str(out), "--seconds", "0.05", "--out", str(tmp_path / "run")]
    assert main(run) == 0
    summary = json.loads((tmp_path / "run" / "summary.json").read_text("utf-8"))
    assert summary["contacts"]["ticks_in_contact"] == summary["ticks"] == 51
    assert 0.1 < summary["largest_force_n"] < 1.0


def test_a_normal_map_and_a_picture_in_colour_are_baked(tmp_path, capsys):
    slope = 0.2 * np.cos(2 * np.pi * np.arange(64) / 16)
    normal = np.stack([np.tile(slope, (64, 1)), np.zeros((64, 64)), np.ones((64, 64))], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    colours = np.round(127.5 * (normal + 1)).astype(np.uint8)
    Image.fromarray(colours).save(tmp_path / "map.png")
    for name, options in (
        ("normal", ["--kind", "normal"]), ("red", ["--colour", "red", "--relief-mm", "0.1"]),
    ):  # fmt: skip
        out = ["--pixel-um", "50", "--out", str(tmp_path / name), "--no-picture"]
        assert main(["bake", str(tmp_path / "map.png"), *options, *out]) == 0
    report = json.loads((tmp_path / "normal" / "bake.json").read_text("utf-8"))
    # A slope of 0.2 over a wave of 0.8 mm.
    assert report["heights_um"][1] == pytest.approx(2 * 0.2 * 800 / (2 * np.pi), rel=0.05)
    capsys.readouterr()
    assert (
        main(["bake", _stone(tmp_path / "a.stl"), "--colour", "red", "--out", str(tmp_path)]) == 2
    )
    assert "colour: for height maps" in capsys.readouterr().err


def test_bad_input_is_one_line(tmp_path, capsys):
    stone, out = _stone(tmp_path / "stone.stl"), ["--out", str(tmp_path / "out")]
    for options, told in (
        (["--faces", "2"], "faces must be a whole number from 4"),
        (["--size", "7"], "size must lie between 32 and 8192"),
        (["--unit", "ell"], "unknown unit 'ell'"),
        (["--pixel-um", "-1"], "--pixel-um"),
        (["--relief-mm", "1"], "height_range: for height maps"),
    ):
        assert main(["bake", stone, *options, *out]) == 2
        said = capsys.readouterr().err
        assert told in said
        assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()
