"""Whole sessions on real scenes with a simulated participant: from the command to the figures."""

import csv
import json

import numpy as np
import pytest
from fakes import CHOICE, MAGNITUDE, document

from asperity.cli import main
from asperity.realtime.servo.replay import scene_of_recording
from asperity.runs.recording import read_recording
from asperity.scene.document import write_toml

CONSTANT = document(
    CHOICE, name="hundred", staircase=None,
    forced_choice={"adaptive": "constant"},
    constant={"levels": [0.05, 0.1, 0.2, 0.4, 0.8], "repeats": 20},
)  # fmt: skip


def rows(path):
    with open(path, encoding="utf-8") as file:
        return list(csv.DictReader(file))


def written(folder, made):
    path = folder / "experiment.toml"
    path.write_text(write_toml(made), "utf-8")
    return path


def test_a_hundred_trials_on_a_real_scene_and_what_they_say(tmp_path, capsys):
    file = written(tmp_path, CONSTANT)
    out = tmp_path / "data" / "P1-1"
    command = ["experiment", str(file), "--simulate", "--participant", "P1", "--out", str(out)]
    assert main(command) == 0
    assert "100 answers; the session is complete; next: asperity analyse " in (
        capsys.readouterr().out
    )
    answers, trials = rows(out / "answers.csv"), rows(out / "trials.csv")
    assert len(answers) == 100
    assert len(trials) == 200
    assert {row["level"] for row in answers} == {"0.05", "0.1", "0.2", "0.4", "0.8"}
    # Every tick of every interval, of the very stimulus.
    for row in trials[:4]:
        recording = read_recording(out / row["recording"])
        assert len(recording.time) == int(row["ticks"]) == 51
        texture = json.loads(recording.attributes["document"])["bodies"]["plate"]["texture"]
        assert texture["height"] == pytest.approx(float(row["value"]))
        again = scene_of_recording(recording.attributes)
        assert again.document["bodies"]["plate"]["texture"] == texture
    assert all((out / row["recording"]).is_file() for row in trials)
    force = {float(row["value"]): float(row["largest_force"]) for row in trials}
    assert np.ptp(list(force.values())) > 0.0

    assert main(["analyse", str(tmp_path / "data"), "--samples", "200"]) == 0
    assert "P1-1: threshold 0." in capsys.readouterr().out
    told = json.loads((tmp_path / "data" / "analysis" / "analysis.json").read_text("utf-8"))
    found = told["forced-choice"][0]["psychometric"]
    assert found["threshold_low"] < 0.2 < found["threshold_high"]
    assert found["deviance_p"] > 0.01
    names = {path.name for path in (tmp_path / "data" / "analysis").iterdir()}
    assert {"psychometric_P1-1.png", "trials_P1-1.svg"} <= names
    # The same command again has nothing to do, and changes no answer.
    assert main(command) == 0
    assert rows(out / "answers.csv") == answers


def test_magnitudes_by_what_was_felt(tmp_path, capsys):
    made = document(
        MAGNITUDE, name="felt", magnitude={"blocks": 2, "practice": 0},
        levels={"values": [5e-5, 2e-4, 4e-4, 8e-4]},
        simulated={"rates": "largest_force", "noise": 0.02, "exponent": 1.0},
    )  # fmt: skip
    file, out = written(tmp_path, made), tmp_path / "P1-1"
    options = ["--simulate", "--participant", "P1", "--out", str(out)]
    assert main(["experiment", str(file), *options]) == 0
    # Within the noise the answers are in proportion to what the recordings say.
    answers = np.array([float(row["answer"]) for row in rows(out / "answers.csv")])
    felt = np.array([float(row["largest_force"]) for row in rows(out / "trials.csv")])
    ratio = np.log10(answers / felt)
    assert np.ptp(ratio) < 0.12
    assert np.ptp(np.log10(felt)) > 0.3
    assert main(["analyse", str(out), "--samples", "100"]) == 0
    assert "slope in log-log" in capsys.readouterr().out
    assert (out / "analysis" / "magnitude.png").stat().st_size > 10_000


def test_a_session_goes_on_only_with_the_stimuli_that_it_began_with(tmp_path, capsys):
    made = document(MAGNITUDE, levels={"values": [1e-4, 2e-4]}, magnitude={"blocks": 1})
    file, out = written(tmp_path, made), tmp_path / "P1-1"
    options = ["--simulate", "--participant", "P1", "--out", str(out)]
    assert main(["experiment", str(file), *options]) == 0
    changed = document(made, stimulus={"change": {"force": {"stiffness": 900.0}}})
    written(tmp_path, changed)
    assert main(["experiment", str(file), *options]) == 2
    assert "another state of the experiment's file" in capsys.readouterr().err


def test_what_cannot_be_analysed(tmp_path, capsys):
    assert main(["analyse", str(tmp_path / "none")]) == 2
    assert "no such folder" in capsys.readouterr().err
    assert main(["analyse", str(tmp_path)]) == 2
    assert "no session in" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
