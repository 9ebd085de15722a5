"""Results on stdout, as lines or as JSON; progress without a terminal."""

from __future__ import annotations

import io
import json
import time
from contextlib import redirect_stderr

import numpy as np
import pytest

from asperity.cli import progress
from asperity.cli.main import main
from asperity.cli.result import print_result, set_json


@pytest.fixture
def as_json():
    set_json(True)
    yield
    set_json(False)


def test_lines_for_people(capsys):
    print_result(["one", "two"], {"n": 1})
    assert capsys.readouterr().out == "one\ntwo\n"


def test_data_of_every_kind_is_json(as_json, capsys, tmp_path):
    data = {"a": np.array([1.5, np.nan]), "b": np.float32(2.0), "c": (True, None), "d": tmp_path}
    print_result("one", data)
    told = json.loads(capsys.readouterr().out)
    assert told == {"a": [1.5, None], "b": 2.0, "c": [True, None], "d": str(tmp_path)}


@pytest.mark.parametrize("place", [0, 1])
def test_the_option_may_stand_anywhere(place, capsys):
    words = ["devices"]
    words.insert(place, "--json")
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    names = [one["name"] for one in told]
    assert "simulated" in names
    # No sentence is cut for the table.
    assert main(["devices"]) == 0
    table = set(capsys.readouterr().out.split())
    for one in told:
        assert {*one["what"].split(), *one["attached"].split()} <= table


def test_without_a_terminal_a_line_tells_how_far_it_is(monkeypatch):
    monkeypatch.setattr(progress, "FIRST_LINE", 0.05)
    monkeypatch.setattr(progress, "LINES", 0.05)
    said = io.StringIO()
    with redirect_stderr(said), progress.progress_bars() as bars:
        task = bars.add_task("probe-plate  0.5 N", total=100)
        bars.add_task("what comes after it", total=100)
        bars.update(task, completed=40)
        deadline = time.monotonic() + 5.0
        while said.getvalue().count("\n") < 2 and time.monotonic() < deadline:
            time.sleep(0.01)
    lines = said.getvalue().splitlines()
    assert len(lines) >= 2
    assert set(lines) == {"asperity: probe-plate 0.5 N, 40 %, 0 s so far"}


def test_a_task_that_waits_for_kernels_tells_how_many_are_compiled(monkeypatch):
    kept = [40]
    monkeypatch.setattr("asperity._core.kernels.cache_state", lambda: (None, kept[0]))
    with progress.progress_bars() as bars:
        label = progress.labels()
        first, second = (bars.add_task(what, total=1) for what in ("one", "two"))

        def told():
            return [label(bars.tasks, task) for task in bars.tasks]

        assert told() == ["one", "two"]
        kept[0] = 52
        assert told() == ["one (kernels compiled: 12)", "two"]
        bars.advance(first)
        assert told() == ["one", "two"]
        kept[0] = 60
        assert told() == ["one", "two (kernels compiled: 8)"]
        bars.advance(second)
        assert told() == ["one", "two"]


def test_short_work_says_nothing():
    said = io.StringIO()
    with redirect_stderr(said), progress.progress_bars() as bars:
        bars.add_task("quick", total=1)
    assert said.getvalue() == ""


def test_sound_of_a_run_is_elsewhere(tmp_path, capsys):
    assert main(["sound", str(tmp_path)]) == 2
    assert "without a .nc file that asperity study wrote" in capsys.readouterr().err
    (tmp_path / "recording.h5").touch()
    assert main(["sound", str(tmp_path)]) == 2
    assert "for the sound of a run: asperity export" in capsys.readouterr().err
    (tmp_path / "diameter.nc").touch()
    assert main(["sound", str(tmp_path)]) == 2
    assert "give a .nc file in it: diameter.nc" in capsys.readouterr().err


def test_a_torque_of_rounding_is_none(tmp_path, capsys):
    out = str(tmp_path / "out")
    given = ["--tool", "sphere:2mm", "--target", "box:20x20x5mm", "--seconds", "0.02"]
    assert main(["run", *given, "--out", out]) == 0
    assert " N and 0 mN m;" in capsys.readouterr().out
