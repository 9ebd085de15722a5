"""Methods side by side: pressed alike, measured, written whole or not at all."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from asperity.cli.main import main
from asperity.errors import AsperityError
from asperity.scene.trajectory import ScriptedMotion
from asperity.studies.baselines import METHODS, MethodWrench, choose_methods
from asperity.studies.baselines.protocol import NOTHING
from asperity.studies.comparison import stimuli
from asperity.studies.comparison.compare import CompareSettings, compare
from asperity.studies.comparison.drive import (
    find_pressing_height,
    follow_path,
    mean_push,
    raise_path,
    refuse_slow,
)
from asperity.studies.comparison.write import write_comparison, write_docs


class Spring:
    """Pushes up with so much for every metre below z = 0, and along x by a wave."""

    def __init__(self, stiffness=1000.0, wave=0.0):
        self.stiffness, self.wave, self.asked = stiffness, wave, 0

    def wrench(self, pose):
        self.asked += 1
        depth = -float(pose[2])
        if depth <= 0.0:
            return NOTHING
        push = self.stiffness * depth
        along = push * self.wave * np.sin(2 * np.pi * pose[0] / 2e-3)
        return MethodWrench(np.array([along, 0.0, push]), np.zeros(3), depth, 1)

    def reset(self):
        pass


def straight(count=100):
    poses = np.zeros((count, 7))
    poses[:, 0] = np.linspace(0.0, 6e-3, count)
    poses[:, 3] = 1.0
    return poses


@pytest.mark.parametrize("stiffness", [50.0, 1000.0, 1e5])
@pytest.mark.parametrize("begin", [-1e-3, 0.0, 1e-3])
def test_a_path_is_pressed_to_a_force_from_above_and_from_below(stiffness, begin):
    if 0.3 / stiffness > 7e-3:
        pytest.skip("deeper than is looked")
    spring, poses = Spring(stiffness), raise_path(straight(), begin)
    height = find_pressing_height(spring, poses, 0.3)
    assert mean_push(spring, raise_path(poses, height)) == pytest.approx(0.3, rel=0.01)
    assert spring.asked < 40 * 16


@pytest.mark.parametrize("through", [3.4e-4, 4e-4, 1e-3])
def test_a_path_is_pressed_to_a_force_beyond_which_the_tool_is_let_go(through):
    class Thin(Spring):
        def wrench(self, pose):
            return NOTHING if pose[2] < -through else super().wrench(pose)

    height = find_pressing_height(Thin(), straight(), 0.305)
    assert height == pytest.approx(-3.05e-4, rel=0.01)


def test_a_path_that_meets_nothing_is_refused():
    with pytest.raises(AsperityError, match="at no height within 8 mm"):
        find_pressing_height(Spring(), raise_path(straight(), 0.1), 0.3)


def test_following_times_every_tick_and_stops_when_the_budget_is_spent():
    spring = Spring()
    felt = follow_path(spring, straight(200))
    assert felt.force.shape == (200, 3)
    assert (felt.seconds > 0.0).all()
    assert len(follow_path(spring, straight(200), budget=0.0).force) == 64


@pytest.fixture(scope="module")
def result():
    scene = stimuli.ball_on_plate().changed(
        trajectory={"kind": "slide", "seconds": 0.1, "length": 4e-3, "start": [-2e-3, 0.0, 2e-3]}
    )
    settings = CompareSettings(claims=())
    return compare(scene, choose_methods(["asperity", "minsky", "low-resolution"]), settings)


def test_all_are_pressed_alike_and_timed(result):
    for row in result.rows:
        assert row.reason is None
        assert row.rendered.run.force[:, 2].mean() == pytest.approx(result.push, rel=0.15)
        assert row.rendered.ratio > 0.0
    rms = {row.method.name: row.rendered.band_rms for row in result.rows}
    assert rms["low-resolution"] < 1e-6
    assert rms["asperity"] > 0.01


def test_what_is_written_can_be_read_again(result, tmp_path):
    write_comparison(result, tmp_path, "asperity compare stimulus")
    written = json.loads((tmp_path / "comparison.json").read_text())
    assert [one["name"] for one in written["methods"]] == ["asperity", "minsky", "low-resolution"]
    with (tmp_path / "traces.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(result.poses)
    own = result.rows[0].rendered.run.force
    assert float(rows[7]["asperity_force_x_n"]) == pytest.approx(own[7, 0], rel=1e-4)
    for name in ("traces", "spectra", "cost"):
        assert (tmp_path / f"{name}.png").stat().st_size > 5000
    page = (tmp_path / "comparison.html").read_text()
    assert page.count("<img") == 3
    assert "Minsky 1995" in page
    docs = tmp_path / "docs"
    docs.mkdir()
    write_docs(tmp_path, docs, result, "asperity compare stimulus")
    text = (docs / "comparison.md").read_text()
    assert "(images/comparison_traces.svg)" in text
    assert (docs / "images" / "comparison_traces.svg").is_file()


def test_a_method_that_cannot_says_why_in_its_row(tmp_path):
    scene = stimuli.foot_on_plate().changed(
        trajectory={"kind": "slide", "seconds": 0.05, "length": 3e-3, "start": [-1e-3, 0.0, 2e-3]}
    )
    done = compare(scene, choose_methods(["offset-sphere"]), CompareSettings(claims=()))
    assert done.rows[0].reason == "made for a smooth sphere, and probe is none"
    write_comparison(done, tmp_path, "asperity compare stimulus")
    assert "and probe is none" in (tmp_path / "comparison.md").read_text()


@pytest.mark.parametrize(
    ("failure", "words"), [(AsperityError("too wide"), "too wide"), (MemoryError(), "more memory")]
)
def test_a_method_that_fails_on_the_way_leaves_the_others(failure, words):
    class Failing(Spring):
        def wrench(self, pose):
            if self.asked > 300:
                raise failure
            return super().wrench(pose)

    failing = SimpleNamespace(
        name="failing", label="failing", can=lambda _: None, prepare=lambda _, dt: Failing()
    )
    scene = stimuli.ball_on_plate().changed(
        trajectory={"kind": "slide", "seconds": 0.1, "length": 4e-3, "start": [-2e-3, 0.0, 2e-3]}
    )
    methods = [failing, METHODS["minsky"]]
    rows = compare(scene, methods, CompareSettings(claims=())).rows
    assert words in rows[0].reason
    assert [row.rendered is None for row in rows] == [True, False]


@pytest.mark.slow
def test_a_law_of_one_point_says_that_hammer_and_blocks_are_meshes(tmp_path, capsys):
    out = tmp_path / "out"
    words = ["compare", "hammer-blocks", "--method", "minsky", "--seconds", "0.05"]
    assert main([*words, "--no-properties", "--out", str(out)]) == 0
    assert "minsky: not applicable: a law of one point" in capsys.readouterr().out
    assert "is a mesh" in (out / "comparison.md").read_text()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["probe-plate", "--method", "minski"], "did you mean 'minsky'"),
        (["probe-plate", "--claim", "ofset"], "did you mean 'offset'"),
        (["probe-plate", "--claim", "texture"], "fits 2: torque (torque by texture), tool"),
        (["probe-plate", "--method", "none.py"], "no such file: none.py"),
        (["probe-plat"], "did you mean 'probe-plate'"),
        (["probe-plate", "--motion", "wobble"], "unknown --motion 'wobble'"),
        (["probe-plate", "--seconds", "-1"], "--seconds must lie between"),
        (["probe-plate", "--docs", "/no/such/folder"], "no such folder for --docs"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(options, words, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["compare", *options, "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert not out.exists()


def own_method(text, tmp_path):
    path = tmp_path / "wall.py"
    path.write_text(text)
    return str(path)


def test_a_method_that_would_take_minutes_is_left_out_with_the_reason(monkeypatch):
    clock = iter(np.arange(0.0, 100.0, 0.5))
    monkeypatch.setattr("time.thread_time", lambda: float(next(clock)))
    with pytest.raises(AsperityError, match=r"a tick takes about 0\.5 s, too long to press"):
        refuse_slow(Spring(), straight(), 1.0)
    refuse_slow(Spring(), straight(), 100.0)


def test_the_method_of_the_documentation_gets_a_row(tmp_path, capsys):
    page = (Path(__file__).parents[3] / "docs/methods/index.md").read_text("utf-8")
    text = page.partition("```python\n")[2].partition("```")[0]
    words = ["compare", "probe-plate", "--method", own_method(text, tmp_path), "asperity"]
    assert main([*words, "--seconds", "0.1", "--out", str(tmp_path / "out")]) == 0
    assert "wall: median" in capsys.readouterr().out
    claims = json.loads((tmp_path / "out/comparison.json").read_text())["methods"][1]["claims"]
    assert claims["silence"]["holds"] is True
    assert claims["offset"]["holds"] is False


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1 / 0", "failed: ZeroDivisionError"),
        ("x = 1", "defines no instance of asperity's Method"),
        ("from asperity.studies.baselines import METHODS\nm = METHODS['ho']", "defines 'ho'"),
    ],
)
def test_a_file_without_a_method_is_refused(text, words, tmp_path, capsys):
    path = own_method(text, tmp_path)
    assert main(["compare", "probe-plate", "--method", path]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def test_trajectories_keep_their_own_motion():
    scene = stimuli.ball_on_plate()
    motion = ScriptedMotion(
        kind="press-and-slide", seconds=0.7, speed=0.02, length=3e-3, start=[-1e-3, 0.0, 2e-3]
    )
    settings = CompareSettings(motion=motion, claims=())
    done = compare(scene, choose_methods(["minsky"]), settings)
    felt = done.rows[0].rendered.run
    assert felt.contacts[0] == 0
    assert felt.contacts[len(felt.contacts) // 2] == 1
