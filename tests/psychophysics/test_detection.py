"""Yes/no, three intervals and the odd one out: d' of observers with a known one."""

import numpy as np
import pytest
from fakes import CHOICE, YES_NO, Nothing, design, document
from scipy.stats import binom, norm

from asperity.errors import AsperityError
from asperity.psychophysics.analysis.detection import (
    TASKS,
    analyse_detection,
    choice_d_prime,
    d_prime_of,
    proportion_right,
    yes_no,
)
from asperity.psychophysics.analysis.detection_fit import fit_detection
from asperity.psychophysics.analysis.results import read_results
from asperity.psychophysics.analysis.thresholds import AnalysisOptions, analyse_threshold
from asperity.psychophysics.expected import expected_interval, expected_lines, simulated_session
from asperity.psychophysics.interfaces.protocol import SimulatedInterface
from asperity.psychophysics.procedures.procedures import procedure
from asperity.psychophysics.session.session import Session

pytestmark = pytest.mark.usefixtures("without_scenes")


def odd(**changes):
    settings = {**CHOICE["forced-choice"], **changes}
    return document(CHOICE, method="odd-one-out", forced_choice=None, odd_one_out=settings)


@pytest.mark.parametrize(
    ("d_prime", "task", "published"),
    [
        # Hacker & Ratcliff (1979), Table 1, and Elliott (1964); Ennis (1993), Table 1, triangle.
        (1.0, "2afc", 0.76), (2.0, "2afc", 0.92), (1.0, "3afc", 0.63), (2.0, "3afc", 0.87),
        (1.0, "oddity", 0.42), (2.0, "oddity", 0.605), (3.0, "oddity", 0.78),
    ],
)  # fmt: skip
def test_proportions_of_published_tables(d_prime, task, published):
    assert proportion_right(d_prime, task) == pytest.approx(published, abs=0.005)
    assert d_prime_of(proportion_right(d_prime, task), task) == pytest.approx(d_prime, abs=1e-6)


@pytest.mark.parametrize("d_prime", [0.0, 0.7, 2.3])
def test_proportions_are_those_of_drawn_observations(d_prime):
    felt = np.random.default_rng(0).normal(size=(400_000, 3))
    felt[:, 0] += d_prime
    far = np.abs(felt - np.median(felt, axis=1, keepdims=True))
    drawn = {
        "2afc": np.mean(felt[:, 0] > felt[:, 1]), "3afc": np.mean(felt.argmax(axis=1) == 0),
        "oddity": np.mean(far.argmax(axis=1) == 0),
    }  # fmt: skip
    for task in TASKS:
        assert proportion_right(d_prime, task) == pytest.approx(drawn[task], abs=0.003)


def test_by_hand():
    found = yes_no(15, 20, 4, 20)
    hit, false = 15.5 / 21, 4.5 / 21
    assert found.d_prime.value == pytest.approx(norm.ppf(hit) - norm.ppf(false))
    assert found.criterion.value == pytest.approx(-0.5 * (norm.ppf(hit) + norm.ppf(false)))
    never = yes_no(20, 20, 0, 20)
    assert np.isfinite(never.d_prime).all()
    assert never.criterion.value == pytest.approx(0.0)
    with pytest.raises(AsperityError, match="21 answers yes in 20 trials with signal"):
        yes_no(21, 20, 0, 20)


@pytest.mark.parametrize(
    ("d_prime", "place", "trials"), [(1.0, 0.5, 50), (2.0, 1.5, 100), (0.4, 0.0, 200)]
)
def test_intervals_of_yes_no_hold_the_truth_as_often_as_they_say(d_prime, place, trials):
    rng, runs = np.random.default_rng(1), 1500
    hits = rng.binomial(trials, norm.cdf(d_prime - place), runs)
    false = rng.binomial(trials, norm.cdf(-place), runs)
    found = [
        yes_no(h, trials, f, trials) for h, f in zip(hits.tolist(), false.tolist(), strict=True)
    ]
    low, high = binom.ppf([0.001, 0.999], runs, [0.94, 0.965])
    for name, truth in (("d_prime", d_prime), ("criterion", place - 0.5 * d_prime)):
        inside = sum(getattr(f, name).low < truth < getattr(f, name).high for f in found)
        assert low <= inside <= high


def test_an_observer_of_yes_no_is_recovered(tmp_path):
    made = design(YES_NO)
    with Session(made, tmp_path / "P1", "P1") as session:
        session.run(Nothing(), SimulatedInterface(made, "P1"), sleep=lambda _: None)
    (found,) = analyse_detection(read_results(tmp_path / "P1"), 0.95)
    assert (found["trials"], found["trials_without"]) == (120, 60)
    assert found == analyse_detection([simulated_session(made, "P1")], 0.95)[0]
    many = design(YES_NO, yes_no={"repeats": 200})
    sessions = analyse_detection([simulated_session(many, f"P{i}") for i in range(60)], 0.95)
    for i, d_prime in enumerate((1.0, 2.0)):
        rows = [one["levels"][i] for one in sessions]
        for name, truth in (("d_prime", d_prime), ("criterion", 0.8 - 0.5 * d_prime)):
            assert np.mean([row[name] for row in rows]) == pytest.approx(truth, abs=0.05)
            inside = sum(row[f"{name}_low"] < truth < row[f"{name}_high"] for row in rows)
            assert inside >= binom.ppf(0.001, 60, 0.95)


def test_the_level_of_d_prime_1_is_inside_its_interval_as_often_as_it_says():
    rng, runs, inside, errors = np.random.default_rng(5), 100, 0, []
    levels, threshold, place = np.array([1.0, 2.0, 4.0]), 2.3, 0.7
    for _ in range(runs):
        yes = rng.binomial(80, norm.cdf((levels / threshold) ** 1.3 - place))
        found = fit_detection(levels, yes, [80] * 3, (rng.binomial(240, norm.cdf(-place)), 240))
        inside += found.low < threshold < found.high
        errors.append(np.log(found.threshold / threshold))
    assert inside >= binom.ppf(0.001, runs, 0.95)
    assert abs(np.mean(errors)) < 0.05
    # Exact rates give the truth back.
    rates = np.round(1e6 * norm.cdf((levels / threshold) ** 1.3 - place))
    found = fit_detection(levels, rates, [1e6] * 3, (round(1e6 * norm.cdf(-place)), 10**6))
    assert found.threshold == pytest.approx(threshold, rel=0.01)
    assert found.exponent == pytest.approx(1.3, rel=0.01)
    assert found.place == pytest.approx(place, abs=0.01)
    assert not found.at_bound


def test_without_sensitivity_there_is_no_level_of_d_prime_1():
    assert fit_detection([1.0, 2.0], [20, 20], [50, 50], (40, 100)).at_bound
    with pytest.raises(AsperityError, match="two distances or more above 0"):
        fit_detection([1.0, 1.0], [20, 20], [50, 50], (40, 100))


@pytest.mark.parametrize(
    ("level", "standard", "levels", "truth"),
    [("weber", 1e-4, [0.1, 0.4], 0.2), ("value", 2e-4, [1.6e-4, 0.4e-4], 1.2e-4),
     ("value", 2e-4, [3e-4, 1e-4], None)],
)  # fmt: skip
def test_the_level_of_d_prime_1_is_on_the_side_of_the_signals(level, standard, levels, truth):
    made = design(
        YES_NO, yes_no={"standard": standard, "level": level, "levels": levels, "repeats": 300},
        simulated={"threshold": 0.2 if level == "weber" else 0.8e-4},
    )  # fmt: skip
    (found,) = analyse_detection([simulated_session(made, "P2")], 0.95)
    if truth is None:
        assert found["fit"] == {}
    else:
        assert found["fit"]["level_at_1_low"] < truth < found["fit"]["level_at_1_high"]
        assert found["fit"]["level_at_1"] == pytest.approx(truth, rel=0.3)


def test_the_stimulus_says_what_is_right_in_yes_no():
    made = design(YES_NO, yes_no={"practice": 6, "without": 20}, catch={"every": 12, "level": 4e-4})
    steps, seen = procedure(made, "P1", 1), []
    while (trial := steps.next()) is not None:
        seen.append(trial)
        steps.answer(trial, 1)
    for trial in seen:
        assert trial.right == int(trial.stimuli[0].value > 0.0)
    counted = [trial for trial in seen if trial.counts]
    assert [sum(t.level == level for t in counted) for level in (5e-5, 1e-4, None)] == [30, 30, 20]
    assert sum(trial.practice for trial in seen) == 6
    assert {trial.level for trial in seen if trial.catch} == {4e-4}
    assert len(seen) <= steps.most == 6 + 80 + 7
    # Every level is spread over the session.
    halves = [sum(t.level == 5e-5 for t in half) for half in (counted[:40], counted[40:])]
    assert min(halves) >= 12


@pytest.mark.parametrize("which", ["3afc", "oddity"])
def test_three_intervals_end_to_end(which, tmp_path):
    base = odd() if which == "oddity" else document(CHOICE, forced_choice={"intervals": 3})
    made = design(base, staircase={"start": [0.8, 0.8], "trials": 200})
    assert made.forced_choice.guess == pytest.approx(1.0 / 3.0)
    with Session(made, tmp_path / "s", "P1") as session:
        session.run(Nothing(), SimulatedInterface(made, "P1"), sleep=lambda _: None)
    result = read_results(tmp_path / "s")[0]
    higher = 0
    for answered in result.answers:
        values = [stimulus.value for stimulus in answered.trial.stimuli]
        (single,) = [i for i, value in enumerate(values) if values.count(value) == 1]
        assert answered.right == (answered.answer == single + 1)
        higher += values[single] > min(values)
    # The odd one is the comparison or the standard; the largest of three is the comparison.
    if which == "oddity":
        assert 150 < higher < 250
    else:
        assert higher == len(result.answers)
    wrong = [(a.trial.target - a.answer) % 3 for a in result.answers if not a.right]
    assert min(wrong.count(1), wrong.count(2)) > 0.25 * len(wrong)
    summary = analyse_threshold(result, AnalysisOptions(samples=20)).summary
    found = summary["psychometric"]
    assert found["guess"] == pytest.approx(1.0 / 3.0)
    assert found["threshold_low"] < 0.2 < found["threshold_high"]
    # Where the true function has a d' of 1.
    truth = 10.0 ** SimulatedInterface(made, "P1").truth.at(proportion_right(1.0, which))
    assert summary["d_prime"]["task"] == which
    assert summary["d_prime"]["level_at_1"] == pytest.approx(truth, rel=0.4)


def test_d_prime_of_constant_levels_is_that_of_the_observer():
    levels = [0.1, 0.2, 0.4]
    base = odd(adaptive="constant")
    made = design(base, staircase=None, constant={"levels": levels, "repeats": 300})
    truth = SimulatedInterface(made, "P1").truth
    result = simulated_session(made, "P1")
    summary = analyse_threshold(result, AnalysisOptions(samples=20)).summary["d_prime"]
    assert [row["level"] for row in summary["levels"]] == levels
    for row in summary["levels"]:
        d_prime = d_prime_of(float(truth(np.log10(row["level"]))), "oddity")
        assert row["trials"] == 300
        assert row["d_prime_low"] < d_prime < row["d_prime_high"]
        assert row["d_prime"] == pytest.approx(d_prime, abs=0.5)


def test_the_odd_one_is_the_comparison_if_wanted():
    made = design(odd(odd="comparison"))
    steps = procedure(made, "P1", 1)
    for _ in range(20):
        values = [stimulus.value for stimulus in steps.next().stimuli]
        assert values.count(2e-4) == 2
        steps.answer(steps.next(), 1)


def test_guessing_has_no_d_prime():
    for task, right in (("2afc", 50), ("3afc", 33), ("oddity", 33)):
        found = choice_d_prime(right, 100, task)
        assert found.low == 0.0
        assert found.high > 0.3
        assert found.value < 0.1


def test_expected_intervals():
    lines = expected_lines(design(YES_NO))
    assert len(lines) == 2
    assert "at level 5e-05 a d' of" in lines[0]
    low, high = expected_interval(design(odd(), staircase={"trials": 60}), sessions=3)
    assert low < 0.2 < high


@pytest.mark.parametrize(
    ("base", "changes", "told"),
    [
        (CHOICE, {"forced_choice": {"intervals": 4}}, "intervals must lie between 2 and 3"),
        (
            CHOICE,
            {"forced_choice": {"intervals": 3, "low": -0.5, "scale": "linear"}},
            "with 3 intervals all levels lie on one side",
        ),
        (CHOICE, {"forced_choice": {"intervals": 3, "more": "smaller"}}, "must have more than the"),
        (CHOICE, {"forced_choice": {"standard": 0.0}}, "a standard of 0 has no fractions"),
        (odd(), {"odd_one_out": {"intervals": 2}}, "odd-one-out: intervals must lie between 3"),
        (odd(), {"odd_one_out": {"odd": "both"}}, "unknown odd 'both'"),
        (odd(), {"staircase": None, "quest": {}}, "quest+ is given, but odd-one-out.adaptive is"),
        (odd(), {"forced_choice": {"low": 0.1}}, "forced-choice is given, but the method is 'odd"),
        (odd(), {"levels": None}, "there are no stimuli"),
        (YES_NO, {"yes_no": {"levels": []}}, "yes-no: levels must hold different numbers"),
        (YES_NO, {"yes_no": {"levels": [0.0, 1e-4]}}, "at 0 there is no signal"),
        (YES_NO, {"yes_no": {"level": "weber"}}, 'give level = "difference" or "value"'),
        (YES_NO, {"yes_no": {"without": 0}}, "without must lie between 1 and"),
        (YES_NO, {"levels": {"values": [1.0, 2.0]}}, "yes-no has yes-no.levels"),
        (YES_NO, {"simulated": {"rates": "band_rms"}}, "simulated.rates must be 'parameter'"),
        (YES_NO, {"catch": {"every": 9, "level": 0.0}}, "catch.level: at 0 there is no signal"),
        (CHOICE, {"catch": {"every": 9, "level": -1.0}}, "catch: level must be a finite number ab"),
        (YES_NO, {"staircase": {}}, "staircase is for the method 'forced-choice', not 'yes-no'"),
    ],
)
def test_what_is_wrong_is_told_in_a_line(base, changes, told):
    with pytest.raises(AsperityError) as caught:
        design(base, **changes)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)
