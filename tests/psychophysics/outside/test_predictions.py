"""A model beside answers: known truths, and the ceiling that raters set."""

import json

import numpy as np
import pandas as pd
import pytest

from asperity.cli import main
from asperity.errors import AsperityError
from asperity.psychophysics.outside.answers import Answers
from asperity.psychophysics.outside.models import read_model, simulate_model
from asperity.psychophysics.outside.predictions import compare_model, plackett_luce
from asperity.psychophysics.outside.reliability import rater_reliability
from asperity.studies.literature.laboratory import Laboratory
from asperity.studies.literature.measures import COLUMNS
from asperity.studies.literature.plates import Dots

CELLS = 24


def rated(noise, people=12, seed=0, slope=0.7):
    """Return magnitude estimates of a truth, each person's on a scale of their own, and it."""
    rng = np.random.default_rng(seed)
    truth = 10.0 ** rng.uniform(-0.5, 0.5, CELLS)
    rows = [
        {"participant": f"P{p}", "stimulus": str(s), "condition": "",
         "rating": 10.0 ** (rng.normal(0.0, noise) + slope * np.log10(truth[s]) + 0.2 * p)}
        for p in range(people) for s in range(CELLS)
    ]  # fmt: skip
    return Answers("magnitude", pd.DataFrame(rows)), {
        (str(s), ""): float(truth[s]) for s in range(CELLS)
    }


def test_reliability_is_that_of_the_formula():
    # Truth with variance 1, noise with variance 4, 16 raters: 1 / (1 + 4 / 16).
    rng = np.random.default_rng(1)
    ratings = rng.normal(size=2000) + 2.0 * rng.normal(size=(16, 2000))
    found = rater_reliability(ratings)
    assert found.reliability == pytest.approx(0.8, abs=0.02)
    assert found.ceiling == pytest.approx(np.sqrt(0.8), abs=0.01)
    assert found.agreement == pytest.approx(1 / np.sqrt(5 * (1 + 4 / 15)), abs=0.02)
    two = rater_reliability(ratings[:2])
    assert two.reliability == pytest.approx(1 / (1 + 4 / 2), abs=0.05)
    assert rater_reliability(ratings[:1]).ceiling is None


def test_the_truth_reaches_the_ceiling_and_explains_everything():
    answers, truth = rated(noise=0.3)
    found = compare_model(answers, truth)
    assert found["slope"] == pytest.approx(0.7, abs=0.1)
    assert found["correlation"] == pytest.approx(found["reliability"]["ceiling"], abs=0.05)
    levels = found["log_likelihood_per_answer"]
    assert levels["null"] < levels["model"] <= levels["cells"]
    assert 0.8 < found["explained"] <= 1.0
    assert not found["turned_round"]


def test_a_model_that_knows_nothing_explains_nothing_and_one_turned_round_is_flagged():
    answers, truth = rated(noise=0.1)
    rng = np.random.default_rng(5)
    names = list(truth)
    shuffled = dict(zip(names, rng.permutation(list(truth.values())), strict=True))
    assert compare_model(answers, shuffled)["explained"] < 0.25
    turned = compare_model(answers, {name: 1.0 / value for name, value in truth.items()})
    assert turned["turned_round"]


def test_the_likelihood_is_the_normal_one():
    from scipy.stats import norm

    answers, truth = rated(noise=0.2, people=3)
    found = compare_model(answers, truth)
    logs = np.log10(answers.matrix())
    logs = logs - logs.mean(axis=1, keepdims=True)
    x = np.log10([truth[cell] for cell in answers.cells])
    left = logs - found["slope"] * (x - x.mean())
    want = norm.logpdf(left, scale=np.sqrt(np.mean(left**2))).mean()
    assert found["log_likelihood_per_answer"]["model"] == pytest.approx(want)


def test_plackett_luce_is_the_product_of_choices():
    scores = np.array([0.3, -1.0, 2.0])
    e = np.exp(scores)
    want = np.log(e[2] / e.sum() * e[0] / (e[0] + e[1]))
    assert plackett_luce(scores, [[2, 0, 1]]) == pytest.approx(want)


def test_choices_of_a_known_slope():
    rng = np.random.default_rng(2)
    values = 10.0 ** np.linspace(-0.5, 0.5, 8)
    rows = []
    for _ in range(4000):
        i, j = rng.choice(8, 2, replace=False)
        p = 1.0 / (1.0 + np.exp(-3.0 * np.log10(values[i] / values[j])))
        rows.append({"participant": "A", "first": str(i), "second": str(j), "condition": "",
                     "chosen": str(i if rng.random() < p else j)})  # fmt: skip
    answers = Answers("choice", pd.DataFrame(rows))
    found = compare_model(answers, {(str(i), ""): float(v) for i, v in enumerate(values)})
    assert found["slope"] == pytest.approx(3.0, abs=0.3)
    assert found["log_likelihood_per_answer"]["null"] == pytest.approx(-np.log(2.0))
    assert found["explained"] > 0.95


def test_values_that_do_not_fit_are_refused():
    answers, truth = rated(noise=0.1)
    with pytest.raises(AsperityError, match="0 of 24 cells"):
        compare_model(answers, {("nobody", ""): 1.0})
    with pytest.raises(AsperityError, match="above 0"):
        compare_model(answers, truth | {("0", ""): -1.0})
    with pytest.raises(AsperityError, match="same value"):
        compare_model(answers, dict.fromkeys(truth, 2.0))


def test_a_simulated_model_is_the_laboratorys(tmp_path):
    (tmp_path / "s.csv").write_text(
        "stimulus,surface,spacing_mm,height_mm,probe_mm\nfine,dots,1,0.2,2\nflat,sinusoid,2,,\n"
    )
    values = simulate_model(tmp_path / "s.csv", "band_rms")
    lab = Laboratory()
    touch = lab.plan.touch(probe=2e-3)
    want = lab.curve(COLUMNS["band_rms"], Dots(height=0.2e-3), touch, [1e-3])[0]
    assert values["fine", ""] == pytest.approx(want)
    assert values["flat", ""] > 0.0
    (tmp_path / "s.csv").write_text("stimulus,surface,spacing_mm\nx,silk,1\n")
    with pytest.raises(AsperityError, match=r"surface must be one of dots.*'silk'"):
        simulate_model(tmp_path / "s.csv", "band_rms")
    with pytest.raises(AsperityError, match="metric"):
        simulate_model(tmp_path / "s.csv", "beauty")


def test_the_command(tmp_path, capsys):
    answers, truth = rated(noise=0.1, people=5)
    answers.table.to_csv(tmp_path / "answers.csv", index=False)
    rows = [{"stimulus": s, "value": value} for (s, _), value in truth.items()]
    pd.DataFrame(rows).to_csv(tmp_path / "model.csv", index=False)
    assert read_model(tmp_path / "model.csv") == pytest.approx(truth)
    command = ["predict", str(tmp_path / "answers.csv")]
    assert main([*command, "--model", str(tmp_path / "model.csv")]) == 0
    said = capsys.readouterr().out
    assert "correlation over 24 cells" in said
    assert "ceiling" in said
    found = json.loads((tmp_path / "answers.prediction" / "prediction.json").read_text("utf-8"))
    assert found["correlation"] > 0.9
    assert (tmp_path / "answers.prediction" / "prediction.png").stat().st_size > 5000
    assert main(command) == 2
    assert "--model, or --stimuli" in capsys.readouterr().err
