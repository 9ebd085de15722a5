"""The experiments of the examples, from the file by the command to the figures."""

import csv
import json
import tomllib
from pathlib import Path

import pytest

from asperity.cli import main
from asperity.scene.document import write_toml

EXAMPLES = Path(__file__).parents[2] / "examples" / "experiments"
SHORT = {
    "any_relief": {"yes-no": {"repeats": 8, "practice": 2}},
    "odd_relief": {"staircase": {"trials": 12}},
    "same_relief": {"matching": {"repeats": 3}},
}  # fmt: skip
PRINTED = {
    "any_relief": ("at level 2e-05 a d' of", "level 4e-05: d' "),
    "odd_relief": ("a threshold of 0.4 would be known to lie", "threshold 0."),
    "same_relief": ("standard far: a PSE of", "standard near: PSE 0.000"),
}
FILES = {
    "any_relief": "detection.png", "odd_relief": "psychometric_P02-1.png",
    "same_relief": "adjustments.svg",
}  # fmt: skip
TABLES = {"any_relief": "detection.csv", "same_relief": "adjustments.csv"}
GROUPS = {
    "any_relief": {"d_prime", "level_at_1"}, "odd_relief": {"threshold"},
    "same_relief": {"pse_far", "pse_near", "jnd_far", "jnd_near"},
}  # fmt: skip


@pytest.mark.parametrize("name", SHORT)
def test_an_example_is_checked_simulated_and_analysed(name, tmp_path, monkeypatch, capsys):
    document = tomllib.loads((EXAMPLES / f"{name}.toml").read_text("utf-8"))
    document["presentation"]["seconds"] = 0.05
    for section, keys in SHORT[name].items():
        document[section] |= keys
    monkeypatch.chdir(tmp_path)
    Path(f"{name}.toml").write_text(write_toml(document), "utf-8")
    expected, found = PRINTED[name]
    assert main(["experiment", f"{name}.toml", "--check"]) == 0
    assert expected in capsys.readouterr().out
    for participant in ("P01", "P02"):
        command = ["experiment", f"{name}.toml", "--simulate", "--participant", participant]
        assert main(command) == 0
    assert "the session is complete" in capsys.readouterr().out
    folder = Path("out/experiment") / name
    assert main(["analyse", str(folder), "--samples", "100"]) == 0
    printed = capsys.readouterr().out
    assert f"P01-1: {found}" in printed
    assert ("catch trials right" in printed) == ("catch" in document)
    assert (folder / "analysis" / FILES[name]).stat().st_size > 5000
    if name != "odd_relief":
        with open(folder / "analysis" / TABLES[name], encoding="utf-8") as file:
            table = list(csv.DictReader(file))
        assert {row["session"] for row in table} == {"P01-1", "P02-1"}
        assert len(table) == (6 if name == "any_relief" else 4)
    told = json.loads((folder / "analysis" / "analysis.json").read_text("utf-8"))
    assert len(told[document["method"]]) == 2
    assert set(told["group"]) == GROUPS[name]
    methods = (folder / "analysis" / "methods.md").read_text("utf-8")
    assert "The last answer could be taken back" in methods
    # Every interval was recorded from the scene of its own stimulus.
    with open(folder / "P01-1" / "trials.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert all((folder / "P01-1" / row["recording"]).is_file() for row in rows)
    if name == "same_relief":
        assert {row["stimulus"] for row in rows if row["interval"] == "1"} == {"far", "near"}
