"""`asperity run`: from a scene to files, whole or not at all."""

import json

import numpy as np
import pytest
from PIL import Image

from asperity.cli import main
from asperity.runs.recording import read_recording
from asperity.scene.builtin import load_scene

QUICK = ["--seconds", "0.2"]
FILES = {
    "summary.json", "recording.h5", "picture.png", "force.png", "force.svg", "torque.png",
    "torque.svg", "spectrum.png", "spectrum.svg",
}  # fmt: skip


def test_a_run_leaves_numbers_a_recording_and_figures(full_pictures, tmp_path, capsys):
    out = tmp_path / "out"
    options = ["--speed-mm-s", "120", "--force-n", "0.4", "--anti-alias", "band"]
    assert main(["run", "probe-plate", *QUICK, *options, "--out", str(out)]) == 0
    assert {path.name for path in out.glob("[!.]*")} == FILES
    summary = json.loads((out / "summary.json").read_text("utf-8"))
    recording = read_recording(out / "recording.h5")
    assert summary["ticks"] == len(recording.time) == 201
    assert list(summary["tick_us"]) == ["median", "p95", "p99", "p999", "max"]
    assert list(summary["tick_us"].values()) == sorted(summary["tick_us"].values())
    assert summary["status"] == {"certified": 201, "budget_spent": 0, "overflow": 0}
    assert summary["contacts"] == {"ticks_in_contact": 201, "mean": 1.0, "largest": 1}
    force = np.linalg.norm(recording.contact_wrench[:, :3], axis=1)
    assert summary["largest_force_n"] == pytest.approx(force.max())
    assert recording.contact_wrench[0, 2] == pytest.approx(0.4, rel=1e-6)
    assert summary["anti_alias"]["mode"] == "band"
    assert summary["anti_alias"]["delay_s"] == pytest.approx(2.5e-3)
    assert summary["anti_alias"]["ticks_active"] == np.count_nonzero(recording.flags & 1) > 50
    assert summary["trajectory"]["speed"] == pytest.approx(0.12)
    assert recording.attributes["scene"] == "probe-plate"
    with Image.open(out / "picture.png") as picture:
        assert min(picture.size) > 500
        assert len(np.unique(np.asarray(picture.convert("L")))) > 100
    said = capsys.readouterr().out
    assert "201 of 201 depths certified" in said
    assert "anti-aliased (band)" in said


def test_a_hand_holds_the_tool_on_its_coupling(tmp_path, capsys):
    out = tmp_path / "out"
    options = ["--hand", "--coupling", "implicit", "--force-n", "0.4"]
    assert main(["run", "probe-plate", *QUICK, *options, "--out", str(out)]) == 0
    summary = json.loads((out / "summary.json").read_text("utf-8"))
    recording = read_recording(out / "recording.h5")
    assert summary["coupling"]["mode"] == recording.attributes["coupling"] == "implicit"
    assert summary["coupling"]["tool_put_back"] == 0
    assert summary["hand"]["gained_j"] == 0.0
    # The hand yields, the tool lags, and what is felt is the coupling's, not the contact's.
    assert np.ptp(recording.handle_pose[:, 2]) > 1e-5
    assert np.abs(recording.tool_pose - recording.handle_pose).max() > 1e-5
    assert np.abs(recording.device_wrench - recording.contact_wrench).max() > 1e-3
    felt = recording.device_wrench[100:, 2].mean()
    assert felt == pytest.approx(recording.contact_wrench[100:, 2].mean(), rel=0.1)
    assert "hand: " in capsys.readouterr().out
    assert main(["run", "probe-plate", "--coupling", "loose", "--out", str(out)]) == 2
    assert "direct, implicit, semi-implicit, static" in capsys.readouterr().err


def test_a_scene_of_one_s_own_and_a_file_of_poses(tmp_path):
    load_scene("probe-plate-grating").save(tmp_path / "mine")
    rows = np.zeros((3, 8))
    rows[:, 0], rows[:, 1], rows[:, 3], rows[:, 4] = [0, 0.05, 0.1], [0, 4e-3, 0], 1.7e-3, 1.0
    np.savetxt(tmp_path / "poses.csv", rows, delimiter=",")
    out = tmp_path / "out"
    arguments = ["run", str(tmp_path / "mine"), "--trajectory", str(tmp_path / "poses.csv")]
    assert main([*arguments, "--out", str(out)]) == 0
    summary = json.loads((out / "summary.json").read_text("utf-8"))
    assert summary["scene"] == "mine"
    assert summary["trajectory"] == {"kind": "poses", "file": "poses.csv", "seconds": 0.1}
    assert 0 < summary["contacts"]["ticks_in_contact"] <= 101
    # The same motion with the real part last, in millimetres.
    rows[:, 1:4] *= 1e3
    np.savetxt(tmp_path / "p.csv", rows[:, [0, 1, 2, 3, 5, 6, 7, 4]], delimiter=",")
    last = [*arguments[:2], "--trajectory", f"{tmp_path / 'p.csv'}:unit=mm", "--order", "xyzw"]
    assert main([*last, "--out", str(tmp_path / "last")]) == 0
    one, two = (read_recording(folder / "recording.h5") for folder in (out, tmp_path / "last"))
    np.testing.assert_allclose(two.tool_pose, one.tool_pose, atol=1e-12)


def test_a_saved_scene_has_what_the_options_changed(tmp_path):
    options = ["--seconds", "0.05", "--speed-mm-s", "40", "--depth-mm", "0.1"]
    saved = ["--coupling", "implicit", "--anti-alias", "band", "--save", str(tmp_path / "scene")]
    first, again, pressed = (tmp_path / name for name in ("first", "again", "pressed"))
    assert main(["run", "probe-plate", *options, *saved, "--out", str(first)]) == 0
    assert main(["run", str(tmp_path / "scene"), "--out", str(again)]) == 0
    one, two = (read_recording(folder / "recording.h5") for folder in (first, again))
    np.testing.assert_array_equal(one.device_wrench, two.device_wrench)
    # A force takes the place of the saved depth.
    further = ["--force-n", "0.4", "--save", str(tmp_path / "other"), "--out", str(pressed)]
    assert main(["run", str(tmp_path / "scene"), *further]) == 0
    motion = load_scene(tmp_path / "other").motion
    assert (motion.press_force, motion.press_depth, motion.speed) == (0.4, None, 0.04)


def test_the_same_command_gives_the_same_forces(tmp_path):
    wrenches = []
    for name in ("a", "b"):
        arguments = ["run", "probe-plate-dots", "--seconds", "0.05", "--seed", "3"]
        assert main([*arguments, "--out", str(tmp_path / name)]) == 0
        wrenches.append(read_recording(tmp_path / name / "recording.h5").contact_wrench)
    np.testing.assert_array_equal(*wrenches)


@pytest.mark.parametrize(
    ("options", "names"),
    [
        (["probe-plat"], ["probe-plat", "did you mean 'probe-plate'"]),
        (["probe-plate", "--trajectory", "slid"], ["slid", "did you mean 'slide'"]),
        (["probe-plate", "--trajectory", "none.csv"], ["no such file", "none.csv"]),
        (["probe-plate", "--trajectory", "a.csv:ordre=xyzw"], ["ordre", "order"]),
        (["probe-plate", "--order", "xyzw"], ["--order needs a file of poses"]),
        (["probe-plate", "--speed-mm-s", "0"], ["--speed-mm-s", "between 0.1 and 10000"]),
        (["probe-plate", "--seconds", "nan"], ["--seconds", "nan"]),
        (["probe-plate", "--force-n", "1", "--depth-mm", "1"], ["--force-n", "--depth-mm"]),
        (["probe-plate", "--anti-alias", "yes"], ["--anti-alias", "off, tick, band"]),
        (["probe-plate", "--seed", "-1"], ["--seed", "between 0 and"]),
    ],
)
def test_bad_options_are_refused_in_one_line(options, names, tmp_path, capsys):
    assert main(["run", *options, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert said[0].startswith("asperity: error:")
    for name in names:
        assert name in said[0]
    assert list(tmp_path.iterdir()) == []


def write_slab(path, size):
    """Write a box without texture coordinates as OBJ [mm]."""
    x, y, z = (0.5 * s for s in size)
    corners = [(a, b, c) for a in (-x, x) for b in (-y, y) for c in (-z, z)]
    sides = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    lines = [f"v {a} {b} {c}" for a, b, c in corners] + [f"f {side}" for side in sides]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


@pytest.fixture
def meshes(tmp_path):
    grey = np.random.default_rng(3).integers(0, 255, (24, 24)).astype(np.uint8)
    Image.fromarray(grey).save(tmp_path / "rough.png")
    return [
        "run", "--tool", write_slab(tmp_path / "bar.obj", (6, 6, 20)), "--tool-unit", "mm",
        "--target", write_slab(tmp_path / "slab.obj", (40, 30, 5)), "--target-unit", "mm",
        "--target-texture", str(tmp_path / "rough.png"), "--target-relief-mm", "0.05",
        "--target-mapping", "triplanar",
    ]  # fmt: skip


def test_a_run_straight_from_meshes_and_an_image(meshes, tmp_path, capsys):
    out = tmp_path / "out"
    assert main([*meshes, "--seconds", "0.05", "--out", str(out)]) == 0
    summary = json.loads((out / "summary.json").read_text("utf-8"))
    assert summary["scene"] == "bar-on-slab"
    assert summary["contacts"]["ticks_in_contact"] > 25
    assert any("no size for rough.png" in note for note in summary["notes"])
    assert "no size for rough.png" in capsys.readouterr().out
    assert {path.name for path in out.glob("[!.]*")} == FILES


@pytest.mark.parametrize(
    ("change", "names"),
    [
        (["probe-plate"], ["probe-plate", "--tool", "not both"]),
        (["--tool", "none.obj"], ["tool", "none.obj"]),
        (["--tool-unit", "furlong"], ["furlong", "mm"]),
        (["--target-mapping", "uw"], ["mapping", "uw", "choose from", "uv"]),
        (["--target-relief-mm", "-1"], ["--target-relief-mm", "-1"]),
        (["--tool-mapping", "uv"], ["--tool-mapping", "--tool-texture"]),
        (["--tool-relief-mm", "1"], ["--tool-relief-mm", "--tool-texture"]),
        (["--seed", "3"], ["--seed"]),
    ],
)
def test_bad_meshes_are_refused_in_one_line(meshes, change, names, tmp_path, capsys):
    before = sorted(tmp_path.iterdir())
    assert main([*meshes, *change, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == (2 if change[0] in meshes else 1)  # an option given twice is said to be
    for name in names:
        assert name in said[-1]
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("options", "names"),
    [
        ([], ["scene", "--tool", "--target"]),
        (["--tool", "a.obj"], ["--target missing"]),
        (["--target", "a.obj"], ["--tool missing"]),
        (["--tool-unit", "mm"], ["--tool and --target missing"]),
        (["probe-plate", "--target-unit", "mm"], ["probe-plate", "--target-unit", "not both"]),
    ],
)
def test_a_scene_or_both_meshes(options, names, tmp_path, capsys):
    assert main(["run", *options, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    for name in names:
        assert name in said[0]


def test_an_interrupted_run_leaves_nothing(tmp_path, monkeypatch, capsys):
    from asperity.simulation.simulation import Simulation

    step, count = Simulation.step, [0]

    def stop(self, pose):
        count[0] += 1
        if count[0] > 30:
            raise KeyboardInterrupt
        return step(self, pose)

    monkeypatch.setattr(Simulation, "step", stop)
    assert main(["run", "probe-plate", *QUICK, "--out", str(tmp_path / "out")]) == 130
    assert "nothing unfinished was kept" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_what_stands_there_stays(tmp_path):
    (tmp_path / "kept.txt").write_text("mine")
    assert main(["run", "probe-plate", *QUICK, "--out", str(tmp_path)]) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["kept.txt"]
