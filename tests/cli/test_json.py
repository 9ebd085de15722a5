"""With --json each command prints one document, and nothing else, on stdout."""

import ast
import contextlib
import json
import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import asperity
from asperity.cli import main
from asperity.cli.main import COMMANDS
from asperity.cli.result import set_json
from asperity.viewer.browser import chromium

SOURCE = Path(asperity.__file__).parent


@pytest.fixture
def told(capsys):
    """Return a function that runs a command with --json, and returns its document."""

    def run(*words):
        capsys.readouterr()
        try:
            assert main([*words, "--json"]) == 0
        finally:
            set_json(False)
        return json.loads(capsys.readouterr().out)

    return run


SWEEP = """
schema = 1
title = "a small sweep"
kind = "drag"
keep = ["max_acceleration"]

[design]
kind = "grid"

[vary]
spacing = [1e-3, 2e-3, 3e-3]
"""


def test_sweep(told, tmp_path):
    study = tmp_path / "small.toml"
    study.write_text(SWEEP)
    check = told("sweep", str(study), "--check")
    assert check["combinations"] == 3
    assert check["axes"] == [{"name": "spacing", "size": 3, "columns": ["spacing"]}]
    out = tmp_path / "small.zarr"
    done = told("sweep", str(study), "--workers", "0", "--out", str(out))
    assert (done["path"], done["total"], done["done"], done["failed"]) == (str(out), 3, 3, 0)
    again = told("sweep", str(study), "--workers", "0", "--out", str(out))
    assert (again["done"], again["computed"]) == (3, 0)


def test_findings(told, tmp_path):
    out = tmp_path / "findings"
    found = told("findings", "--spacings", "8", "--data", str(tmp_path), "--out", str(out))
    assert found["out"] == str(out)
    columns = [column["name"] for column in found["columns"]]
    assert "max_acceleration" in columns
    assert {finding["id"] for finding in found["findings"]}
    written = json.loads((out / "findings.json").read_text())
    assert written["findings"] == found["findings"]


def test_compare(told, tmp_path):
    out = tmp_path / "compare"
    words = ("--method", "asperity", "minsky", "--claim", "none", "--seconds", "0.1")
    found = told("compare", "probe-plate", *words, "--out", str(out))
    assert [row["name"] for row in found["methods"]] == ["asperity", "minsky"]
    written = json.loads((out / "comparison.json").read_text())
    assert written == {key: value for key, value in found.items() if key != "out"}


def test_experiment(told, tmp_path):
    file = tmp_path / "dots.toml"
    text = (Path(__file__).parents[2] / "examples/experiments/dots.toml").read_text()
    short = re.sub(r"(?m)^blocks = .*$", "blocks = 1", text)
    file.write_text(re.sub(r"(?m)^seconds = .*$", "seconds = 0.2", short))
    check = told("experiment", str(file), "--check")
    assert check["most_trials"] >= check["stimuli"] > 1
    assert check["exploration_s"] == pytest.approx(0.2 * check["most_trials"])
    words = ("--simulate", "--participant", "P01", "--out", str(tmp_path / "P01"))
    done = told("experiment", str(file), *words)
    assert (done["complete"], done["folder"]) == (True, str(tmp_path / "P01"))
    assert done["answers"] == check["most_trials"]


RATINGS = "stimulus,rating\nx,1\ny,2\nz,4\nw,3\n"
TARGET = "[target]\nvalue = 1.2\n[search]\ncandidates = 1\nstarts = 1\nstrokes = 1\n"
COMMAND_LINES = {
    "demo": ["demo", "--out", "o"],
    "study": ["study", "speed", "--spacings", "5"],
    "run": ["run", "probe-plate", "--seconds", "0.05"],
    "view": ["view", "probe-plate", "--no-open", "--port", "0", "--seconds", "0.2"],
    "record": ["record", "probe-plate", "--seconds", "0.2"],
    "replay": ["replay", "run", "--out", "r"],
    "export": ["export", "run", "--kinds", "csv"],
    "sound": ["sound", "study/speed.nc"],
    "stability": ["stability", "probe-plate", "--rates-khz", "1", "--dampings-n-s-m", "1",
                  "--places", "1"],
    "findings": ["findings", "--spacings", "8", "--data", "."],
    "fit": ["fit", "probe-plate", "--speeds-mm-s", "60", "90", "--forces-n", "0.5",
            "--seconds", "0.6", "--rate-khz", "1"],
    "devices": ["devices"],
    "sweep": ["sweep", "sweep.toml", "--workers", "0", "--out", "sweep.zarr"],
    "plot": ["plot", "sweep.zarr"],
    "bake": ["bake", "map.npy", "--pixel-um", "50", "--no-picture"],
    "design": ["design", "target.toml"],
    "compare": ["compare", "probe-plate", "--method", "minsky", "--claim", "none",
                "--seconds", "0.05"],
    "experiment": ["experiment", "dots.toml", "--check"],
    "analyse": ["analyse", "a.csv", "b.csv", "--samples", "100"],
    "predict": ["predict", "a.csv", "--model", "model.csv"],
    "doctor": ["doctor"],
}  # fmt: skip
SLOW = ("demo", "design", "findings")
"""What takes minutes, or is called just so by a test of its own."""
OTHER_LINES = [
    ["replay", "run", "--no-open", "--port", "0"],
    ["view", "--simulate", "ball.xml", "--no-open", "--port", "0", "--seconds", "0.2"],
    ["devices", "check", "haply-fake", "--yes"],
]
BALL = """<mujoco><custom><text name="texture:floor" data="knurl:0.8mm"/></custom>
<worldbody><geom name="floor" type="plane" size="1 1 .1"/><body pos="0 0 .02">
<freejoint/><geom name="ball" type="sphere" size=".01"/></body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """Return a folder with what the commands read."""
    folder = tmp_path_factory.mktemp("desk")
    for name, text in {
        "a.csv": RATINGS, "b.csv": RATINGS, "target.toml": TARGET, "sweep.toml": SWEEP,
        "ball.xml": BALL, "model.csv": "stimulus,value\nx,1\ny,2\nz,3\nw,4\n",
        "dots.toml": (Path(__file__).parents[2] / "examples/experiments/dots.toml").read_text(),
    }.items():  # fmt: skip
        (folder / name).write_text(text)
    np.save(folder / "map.npy", 1e-5 * np.random.default_rng(0).random((48, 48)))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["run", "probe-plate", "--seconds", "0.3", "--out", "run"]) == 0
        assert main([*COMMAND_LINES["study"], "--out", "study"]) == 0
        assert main(COMMAND_LINES["sweep"]) == 0
    return folder


def test_every_command_has_a_line_here():
    assert set(COMMAND_LINES) == {get_args(hint)[1].name for hint in get_args(COMMANDS)}


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=pytest.mark.slow if name in SLOW else ()) for name in COMMAND_LINES
])  # fmt: skip
def test_every_command_prints_one_document(name, told, desk, monkeypatch):
    monkeypatch.chdir(desk)
    assert told(*COMMAND_LINES[name], *_folder(name))


@pytest.mark.parametrize("words", OTHER_LINES, ids=" ".join)
def test_so_does_every_way_of_calling_it(words, told, desk, monkeypatch):
    import asperity.viewer.replayed

    monkeypatch.chdir(desk)
    shown = asperity.viewer.replayed.recording_page

    @contextlib.contextmanager
    def closed_at_once(*given, **options):
        with shown(*given, **options) as page:
            page._stopping.set()
            yield page

    monkeypatch.setattr(asperity.viewer.replayed, "recording_page", closed_at_once)
    assert told(*words)


def _folder(name):
    """Return the option by which a command writes into a folder of its own."""
    options = get_args(next(h for h in get_args(COMMANDS) if get_args(h)[1].name == name))[0]
    given = "--out" in COMMAND_LINES[name] or "out" not in options.__dataclass_fields__
    given |= name == "findings"  # into a folder: `test_findings`
    return [] if given else ["--out", f"out-{name}"]


@pytest.mark.skipif(chromium() is None, reason="no Chromium is installed")
@pytest.mark.slow
def test_a_picture_of_the_page_is_a_document(told, tmp_path):
    picture = tmp_path / "page.jpg"
    made = told("view", "probe-plate", "--port", "0", "--screenshot", str(picture))
    assert made == {"picture": str(picture), "scene": "probe-plate"}


@pytest.mark.parametrize("path", sorted((SOURCE / "cli").glob("*.py")), ids=lambda path: path.stem)
def test_no_command_writes_on_stdout_by_itself(path):
    if path.stem in ("result", "main"):
        return
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "print":
            assert any(keyword.arg == "file" for keyword in node.keywords), node.lineno
