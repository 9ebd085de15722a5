"""With --json each command prints one document, and nothing else, on stdout."""

import json
import re
from pathlib import Path

import pytest

from asperity.cli import main
from asperity.cli.result import set_json


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
