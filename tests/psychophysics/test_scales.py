"""Scales from paired comparisons and rankings."""

import itertools
import json

import numpy as np
import pytest
from fakes import PAIRS, design
from scipy.special import ndtri

from asperity.errors import AsperityError
from asperity.psychophysics.analysis.analysis import analyse
from asperity.psychophysics.analysis.results import AnsweredTrial, SessionResult
from asperity.psychophysics.analysis.scales import circular_triads, fit_scale, predicted, wins
from asperity.psychophysics.analysis.thresholds import AnalysisOptions
from asperity.psychophysics.session.trials import Trial


def test_two_stimuli_in_closed_form():
    orders = [(0, 1)] * 300 + [(1, 0)] * 100
    bradley = fit_scale("ab", orders, samples=20)
    assert bradley.values[0] - bradley.values[1] == pytest.approx(np.log(3.0), rel=0.01)
    thurstone = fit_scale("ab", orders, model="thurstone", samples=20)
    assert thurstone.values[0] - thurstone.values[1] == pytest.approx(ndtri(0.75), rel=0.01)
    for scale in (bradley, thurstone):
        assert predicted(scale)[0, 1] == pytest.approx(0.75, abs=0.005)
        assert scale.values.mean() == pytest.approx(0.0, abs=1e-12)
        assert not scale.separated


@pytest.mark.parametrize("model", ["bradley-terry", "thurstone"])
def test_a_known_scale_comes_back(model):
    truth = np.array([-1.2, -0.3, 0.2, 1.3])
    rng = np.random.default_rng(2)
    orders = []
    for i, j in itertools.combinations(range(4), 2):
        apart = truth[i] - truth[j]
        for _ in range(100):
            noise = rng.logistic() if model == "bradley-terry" else rng.normal()
            orders.append((i, j) if apart + noise > 0 else (j, i))
    scale = fit_scale("abcd", orders, model=model, samples=100)
    np.testing.assert_allclose(scale.values, truth, atol=0.3)
    assert np.all((scale.low < truth) & (truth < scale.high))


def test_rankings_are_rows_of_choices():
    truth = np.array([-0.8, 0.0, 0.1, 0.7])
    rng = np.random.default_rng(3)
    # Luce's: the order of a scale with Gumbel noise.
    orders = [list(np.argsort(-(truth + rng.gumbel(size=4)))) for _ in range(400)]
    scale = fit_scale("abcd", orders, samples=50)
    np.testing.assert_allclose(scale.values, truth - truth.mean(), atol=0.2)


def test_one_that_always_wins_has_a_finite_place_and_is_told():
    scale = fit_scale("abc", [(0, 1), (0, 2), (1, 2), (2, 1)] * 3, samples=50)
    assert np.isfinite(scale.values).all()
    assert scale.separated
    assert np.argmax(scale.values) == 0


def test_circles():
    table = wins(3, [(0, 1), (1, 2), (2, 0)])
    assert circular_triads(table) == (1, 1)
    assert circular_triads(wins(3, [(0, 1), (1, 2), (0, 2)])) == (0, 1)
    assert circular_triads(wins(3, [(0, 1), (1, 0), (1, 2), (0, 2)])) == (0, 0)


def test_a_session_is_analysed_to_a_file_that_can_be_read(tmp_path):
    made = design(PAIRS)
    stimuli, given = made.all_stimuli(), []
    for pair in list(itertools.permutations(stimuli, 2)) * 3:
        answer = 1 if pair[0].value > pair[1].value else 2
        trial = Trial(len(given) + 1, "choice", pair, 1)
        given.append(AnsweredTrial(trial, answer, None, 1.0, ({}, {})))
    result = SessionResult("P1", 1, made, made.digest, tuple(given), True, True)
    analyse([result], tmp_path, AnalysisOptions(samples=20))
    told = json.loads((tmp_path / "analysis.json").read_text("utf-8"))["pairs"]
    assert (told["circular_triads"], told["triads"]) == (0, 4)
    assert told["scales"][0]["values"] == sorted(told["scales"][0]["values"])
    assert {"scale.png", "choices.svg"} <= {path.name for path in tmp_path.iterdir()}


def test_no_answers():
    with pytest.raises(AsperityError, match="at least one answer"):
        fit_scale("ab", [])
