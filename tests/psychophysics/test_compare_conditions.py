"""Several people in two conditions: from their sessions to tables, figures and the methods."""

import csv
import json

import numpy as np
import pytest
from fakes import CHOICE, MAGNITUDE, Nothing, design, document

from asperity.cli import main
from asperity.psychophysics.analysis.analysis import file_name
from asperity.psychophysics.analysis.methods import REFERENCES, methods_text
from asperity.psychophysics.analysis.thresholds import AnalysisOptions
from asperity.psychophysics.design import parse_design
from asperity.psychophysics.interfaces.protocol import SimulatedInterface
from asperity.psychophysics.session.session import Session

PEOPLE = ("P1", "P2", "P3")


def sessions(folder, made, people=PEOPLE):
    """Let simulated participants do an experiment; return its folder."""
    for name in people:
        with Session(parse_design(made), folder / f"{name}-1", name) as session:
            front = SimulatedInterface(session.design, name)
            session.run(Nothing(), front, sleep=lambda _: None)
    return folder


def rows(path):
    with open(path, encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """Two conditions with thresholds of 0.15 and 0.3, analysed."""
    folder = tmp_path_factory.mktemp("data")
    staircase = {"start": [0.8, 0.8], "trials": 60}
    one = document(
        CHOICE, name="fine grid", staircase=staircase, simulated={"threshold": 0.15}, seed=3
    )
    two = document(
        CHOICE, name="coarse grid", staircase=staircase, simulated={"threshold": 0.3}, seed=4
    )
    folders = [str(sessions(folder / name, made)) for name, made in (("a", one), ("b", two))]
    command = ["analyse", *folders, "--samples", "100", "--proportion", "0.8"]
    assert main(command) == 0
    return folder, folder / "comparison", command


def test_the_ratio_of_the_thresholds_comes_back(compared, capsys):
    _, out, command = compared
    found = json.loads((out / "comparison.json").read_text("utf-8"))
    (one,) = found["comparisons"]["threshold"]
    assert (one["first"], one["second"], one["people"]) == ("fine grid", "coarse grid", 3)
    assert one["ratio"]["low"] < 2.0 < one["ratio"]["high"]
    assert found["notes"] == []
    for name, truth in (("fine grid", 0.15), ("coarse grid", 0.3)):
        mean = found["conditions"][name]["group"]["threshold"]["mean"]
        # One draw of an interval of 95 % from three people may just miss it.
        assert 0.97 * mean["low"] < truth < 1.03 * mean["high"]
    assert main(["--json", *command]) == 0
    assert json.loads(capsys.readouterr().out)["comparisons"] == found["comparisons"]


def test_tables_are_tidy(compared):
    _, out, _ = compared
    table = rows(out / "thresholds.csv")
    assert [(row["condition"], row["participant"]) for row in table] == [
        (condition, name) for condition in ("fine grid", "coarse grid") for name in PEOPLE
    ]
    for row in table:
        for name in ("threshold", "at_proportion", "jnd", "weber_fraction", "width", "slope"):
            low, value, high = (float(row[f"{name}{end}"]) for end in ("_low", "", "_high"))
            assert low <= value <= high
        assert float(row["weber_fraction"]) == pytest.approx(float(row["threshold"]), rel=1e-4)
        assert float(row["jnd"]) == pytest.approx(2e-4 * float(row["threshold"]), rel=1e-4)
        assert row["pse"] == ""
    answers = rows(out / "answers.csv")
    assert len(answers) == 6 * 120
    assert {row["answered_by"] for row in answers} == {"simulated"}


def test_every_measure_has_its_figures(compared):
    _, out, _ = compared
    names = {str(path.relative_to(out)) for path in out.rglob("*.svg")}
    expected = (
        "comparison_threshold", "comparison_at_proportion", "fine_grid/group_threshold",
        "coarse_grid/psychometric_P3-1",
    )  # fmt: skip
    assert {f"{name}.svg" for name in expected} <= names


def test_methods_name_procedure_rules_stopping_and_authors(compared):
    _, out, _ = compared
    text = (out / "methods.md").read_text("utf-8")
    for part in (
        "3 participants", "6 sessions", "standard, 0.2 mm", "weighted up-down staircases",
        "Kaernbach, 1991", "75.0 % right", "after 60 trials each", "factors of 2, 1.41, 1.19",
        "Weibull", "simulated participant", "paired t tests", "- Kaernbach, C. (1991).",
    ):  # fmt: skip
        assert part in text
    assert "Levitt" not in text  # nothing of his was used


@pytest.mark.parametrize(
    ("sections", "parts"),
    [
        ({"staircase": {"down": 2, "up_ratio": 1.0, "reversals": 10}},
         ("Levitt, 1971", "2 right answers in a row", "70.7 % right", "or 10 reversals")),
        ({"forced_choice": {"adaptive": "quest+"}, "staircase": None, "quest": {"until": 0.05}},
         ("Watson, 2017", "160 trials", "fell below 0.05")),
        ({"forced_choice": {"adaptive": "constant", "feedback": True}, "staircase": None,
          "constant": {"levels": [0.1, 0.4]}},
         ("constant stimuli", "2 levels (0.1, 0.4)", "80 trials", "answer was right")),
    ],
)  # fmt: skip
def test_methods_of_every_rule(sections, parts):
    text = methods_text({"one": design(CHOICE, **sections)}, [], AnalysisOptions())
    for part in parts:
        assert part in text
    assert all(key.split(",")[0].split(" ")[0] in entry for key, entry in REFERENCES.items())


def test_same_orders_in_both_conditions_are_noted(compared, capsys, tmp_path):
    folder, _, _ = compared
    again = sessions(tmp_path / "c", document(CHOICE, name="third", seed=3), ("P1",))
    assert main(["analyse", str(folder / "a"), str(again), "--samples", "100",
                 "--out", str(tmp_path / "out")]) == 0  # fmt: skip
    shown = capsys.readouterr().out
    assert "have the same seed (3)" in shown
    assert "fewer than two people" in shown


def test_both_sides_of_the_standard_give_pse_and_jnd(tmp_path, capsys):
    made = document(
        CHOICE, name="sides", staircase=None,
        forced_choice={"low": -0.6, "high": 0.6, "scale": "linear", "adaptive": "constant"},
        constant={"levels": [-0.5, -0.3, -0.1, 0.1, 0.3, 0.5], "repeats": 30},
        simulated={"threshold": 0.1, "width": 0.6, "function": "normal", "lapse": 0.0},
    )  # fmt: skip
    folder = sessions(tmp_path / "sides", made, ("P1", "P2"))
    assert main(["analyse", str(folder), "--samples", "100", "--function", "normal"]) == 0
    capsys.readouterr()
    first = rows(folder / "analysis" / "thresholds.csv")[0]
    assert float(first["pse_low"]) < 2e-4 * 1.1 < float(first["pse_high"])
    # Half of 0.25 to 0.75 of a normal function: 0.6745 SD; the width is 2 x 1.645 SD.
    jnd = 2e-4 * 0.6 * 0.6745 / (2.0 * 1.645)
    assert float(first["jnd_low"]) < jnd < float(first["jnd_high"])
    found = json.loads((folder / "analysis" / "analysis.json").read_text("utf-8"))
    assert set(found["group"]) == {"pse", "jnd"}


def test_exponents_are_compared_within_people(tmp_path, capsys):
    own = {"spread": 0.05, "noise": 0.03}
    folders = [
        str(sessions(tmp_path / name, document(
            MAGNITUDE, name=name, seed=seed, simulated={"exponent": exponent, **own})))
        for name, seed, exponent in (("slow", 3, 0.6), ("fast", 4, 0.8))
    ]  # fmt: skip
    assert main(["analyse", *folders]) == 0
    assert "fast against slow, exponent: difference" in capsys.readouterr().out
    found = json.loads((tmp_path / "comparison" / "comparison.json").read_text("utf-8"))
    (one,) = found["comparisons"]["exponent"]
    assert one["difference"]["low"] < 0.2 < one["difference"]["high"]
    # The same people: whoever has the higher exponent has it in both conditions.
    slow, fast = (
        [person["value"] for person in found["conditions"][name]["group"]["exponent"][
            "participants"].values()]
        for name in ("slow", "fast")
    )  # fmt: skip
    assert sorted(range(3), key=slow.__getitem__) == sorted(range(3), key=fast.__getitem__)
    text = (tmp_path / "comparison" / "methods.md").read_text("utf-8")
    assert "magnitude estimation; Stevens, 1957" in text
    assert "- Morey" in text


def test_sessions_are_told_as_they_are_fitted_and_conditions_are_named(tmp_path):
    from asperity.psychophysics.analysis.analysis import analyse_conditions
    from asperity.psychophysics.analysis.results import read_conditions

    staircase = {"start": [0.8], "trials": 20}
    made = [document(CHOICE, name=name, staircase=staircase, seed=k) for k, name in enumerate("ab")]
    folders = [sessions(tmp_path / one["name"], one, PEOPLE[:2]) for one in made]
    told = []
    out = tmp_path / "out"
    out.mkdir()
    options = AnalysisOptions(samples=100)
    analyse_conditions(read_conditions(folders), out, options, told.append)
    assert told == ["P1-1", "P2-1"] * 2
    assert "in 2 conditions (a, b)." in (out / "methods.md").read_text("utf-8")


def test_methods_of_yes_no_and_adjustment():
    base = document(CHOICE, forced_choice=None, staircase=None)
    yes_no = base | {"method": "yes-no", "yes-no": {"standard": 2e-4, "levels": [0.2, 0.4]}}
    text = methods_text({"one": parse_design(yes_no)}, [], AnalysisOptions())
    for part in ("In 200 trials there was no signal", "0.2, 0.4", "Hautus, M. J. (1995)"):
        assert part in text
    axis = {"standard": 2e-4, "low": 5e-5, "high": 8e-4, "step": 1.1}
    adjusted = base | {"method": "adjustment", "adjustment": axis}
    text = methods_text({"one": parse_design(adjusted)}, [], AnalysisOptions())
    for part in ("method of adjustment", "24 times for each standard", "mean of the settings"):
        assert part in text


def test_conditions_of_different_methods_are_refused(compared, tmp_path, capsys):
    folder, _, _ = compared
    other = sessions(tmp_path / "m", document(MAGNITUDE, name="numbers"), ("P1",))
    assert main(["analyse", str(folder / "a"), str(other), "--out", str(tmp_path / "o")]) == 2
    assert "fine grid (forced-choice), numbers (magnitude)" in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


def test_names_of_conditions_become_names_of_folders():
    assert file_name("Fine ridges, 2 mm") == "Fine_ridges_2_mm"
    assert file_name("../..") == "condition"


@pytest.mark.parametrize("apart", [(0.1, 0.3), (0.2, 0.2), (0.0, 0.0)])
def test_two_people_are_compared(apart):
    """There is no Hedges' correction of two, and no spread where both differ alike."""
    from asperity.psychophysics.analysis.group import _compared

    one = _compared("a", "b", np.array(apart), False, 0.95)
    found = json.loads(json.dumps(one.summary, allow_nan=False))
    assert found["hedges_gz"] is None
    assert found["difference"]["value"] == pytest.approx(sum(apart) / 2)
    assert (found["t"] is None) == (apart == (0.2, 0.2))
    assert (found["p"] == 1.0) == (apart == (0.0, 0.0))
