"""Adjustment and matching: steps, going on, PSE and JND of participants with known ones."""

import io
import itertools

import numpy as np
import pytest
from fakes import ADJUSTMENT, MATCHING, Nothing, design, document
from scipy.stats import binom

from asperity.errors import AsperityError
from asperity.psychophysics.analysis.adjustments import analyse_adjustments
from asperity.psychophysics.analysis.results import read_results
from asperity.psychophysics.expected import expected_lines, simulated_session
from asperity.psychophysics.interfaces.protocol import Paused, SimulatedInterface
from asperity.psychophysics.interfaces.terminal import TerminalInterface
from asperity.psychophysics.procedures.procedures import procedure
from asperity.psychophysics.session.journal import read_journal
from asperity.psychophysics.session.session import Session
from asperity.psychophysics.session.tables import answers_table

pytestmark = pytest.mark.usefixtures("without_scenes")


def run(made, folder, front):
    with Session(made, folder, "P1") as session:
        return session.run(Nothing(), front, sleep=lambda _: None)


def test_pse_and_jnd_are_inside_their_intervals_as_often_as_they_say():
    made = design(ADJUSTMENT)
    results = [simulated_session(made, f"P{i}") for i in range(120)]
    found = [one["standards"][0] for one in analyse_adjustments(results, 0.95)]
    assert all(len(one["settings"]) == 24 for one in found)
    fewest = binom.ppf(0.001, 120, 0.95)
    # Settings are within half a step of what feels equal: a little more spread than the truth.
    spread = float(np.hypot(0.05, np.log10(1.05) / np.sqrt(12.0)))
    assert sum(one["pse_low"] < 1.15 * 1.5e-4 < one["pse_high"] for one in found) >= fewest
    assert sum(one["sd_low"] < spread < one["sd_high"] for one in found) >= fewest
    assert np.mean([one["pse"] for one in found]) == pytest.approx(1.15 * 1.5e-4, rel=0.01)
    for one in found:
        assert one["constant_error"] == pytest.approx(one["pse"] - 1.5e-4)
        assert one["jnd"] == pytest.approx(one["pse"] * (10.0 ** one["sd"] - 1.0))
        assert one["weber"] == pytest.approx(one["jnd"] / one["pse"])


def test_on_a_linear_scale():
    made = design(
        ADJUSTMENT, adjustment={"scale": "linear", "step": 1e-5, "low": 0.0, "repeats": 200},
        simulated={"bias": 1.0, "noise": 0.1},
    )  # fmt: skip
    (found,) = analyse_adjustments([simulated_session(made, "P1")], 0.95)
    (one,) = found["standards"]
    assert one["pse"] == pytest.approx(1.5e-4, rel=0.03)
    assert one["jnd"] == pytest.approx(one["sd"])
    assert one["jnd"] == pytest.approx(1.5e-5, rel=0.2)


def test_starts_are_drawn_below_and_above_in_turns():
    steps, starts = procedure(design(ADJUSTMENT), "P1", 1), []
    while (trial := steps.next()) is not None:
        starts.append(trial.level)
        assert trial.step == 1
        assert trial.right is None
        steps.answer(trial, 0)
    assert len(starts) == steps.done == steps.most == 24
    assert len(set(starts)) == 24
    middle = np.sqrt(5e-5 * 5e-4)
    above = [start > middle for start in starts]
    assert all(a != b for a, b in itertools.pairwise(above))
    assert all(start < 1.1e-4 or start > 2.3e-4 for start in starts)


@pytest.mark.parametrize("more", ["larger", "smaller"])
def test_an_answer_changes_the_comparison_by_steps(more):
    steps = procedure(design(ADJUSTMENT, adjustment={"more": more, "coarse": 3}), "P1", 1)
    levels = [steps.next().level]
    for answer in (1, -1, 2, -2, -2):
        steps.answer(steps.next(), answer)
        levels.append(steps.next().level)
    by = np.log(np.array(levels[1:]) / np.array(levels[:-1])) / np.log(1.05)
    sign = 1 if more == "larger" else -1
    # It may meet the end of the range.
    expected = sign * np.array([1.0, -1.0, 3.0, -3.0, -3.0])
    inside = (np.array(levels[1:]) > 5e-5) & (np.array(levels[1:]) < 5e-4)
    assert inside.sum() >= 4
    assert by[inside] == pytest.approx(expected[inside], abs=1e-4)
    assert {trial.value for trial in steps.next().stimuli[:1]} == {1.5e-4}


def test_interrupted_within_an_adjustment_it_goes_on_there(tmp_path):
    made = design(MATCHING, matching={"repeats": 2}, session={"break_every": 2})

    class Restless(SimulatedInterface):
        left, rests = 3, 0

        def ready(self, trial, progress):
            self.left -= 1
            if self.left == 0:
                raise Paused

        def rest(self, seconds, progress):
            assert progress.done % 2 == 0
            Restless.rests += 1

    run(made, tmp_path / "whole", SimulatedInterface(made, "P1"))
    for _ in range(80):
        outcome = run(made, tmp_path / "parts", Restless(made, "P1"))
        if outcome.complete:
            break
    assert outcome.complete
    assert (outcome.done, outcome.unit) == (6, "adjustments")
    kept = ("trial", "track", "step", "level", "answer")
    tables = [
        [{k: row[k] for k in kept} for row in answers_table(read_journal(tmp_path / name))]
        for name in ("whole", "parts")
    ]
    assert tables[0] == tables[1]
    assert max(row["step"] for row in tables[0]) > 2
    assert Restless.rests == 2  # no break within an adjustment


def test_matching_of_stimuli_on_another_axis():
    made = document(
        MATCHING, matching={"repeats": 40},
        stimuli={"dots": {"scene": "probe-plate-dots", "value": 2e-4}, "fine": {"value": 1e-4}},
    )  # fmt: skip
    made["matching"].pop("standards")
    made = design(made)
    (found,) = analyse_adjustments([simulated_session(made, "P1")], 0.95)
    assert [one["standard"] for one in found["standards"]] == ["dots", "fine"]
    for one in found["standards"]:
        assert one["pse_low"] < 1.15 * one["value"] < one["pse_high"]
        assert one["constant_error"] is None  # its value is on another axis
    assert len(expected_lines(made)) == 2


def test_an_adjustment_without_end_is_given_up(tmp_path):
    made = design(ADJUSTMENT, adjustment={"steps": 3, "repeats": 2, "practice": 1})
    lines = ["", "+", "", "nonsense", "-", "", "=", "", "+", "", "+", "", "+", "", "--", "", "="]
    written = io.StringIO()
    front = TerminalInterface(io.StringIO("\n".join(lines) + "\n"), written)
    assert run(made, tmp_path / "s", front).complete
    assert "please answer ++, +, =, - or --" in written.getvalue()
    assert "Trial 3 of at most 3." in written.getvalue()
    (found,) = analyse_adjustments(read_results(tmp_path / "s"), 0.95)
    assert (found["adjustments"], found["given_up"]) == (1, 1)
    assert found["standards"][0]["pse"] == pytest.approx(found["standards"][0]["settings"][0])
    assert found["standards"][0]["pse_low"] is None


@pytest.mark.parametrize(
    ("base", "changes", "told"),
    [
        (ADJUSTMENT, {"adjustment": {"standard": 6e-4}}, "standard (0.0006) must lie between low"),
        (ADJUSTMENT, {"adjustment": {"step": 0.9}}, "step must be a factor above 1, got 0.9"),
        (ADJUSTMENT, {"adjustment": {"step": 50.0}}, "step (50) is larger than the range"),
        (ADJUSTMENT, {"adjustment": {"low": -1.0}}, "low must be a finite number above 0"),
        (ADJUSTMENT, {"adjustment": {"standards": [1e-4]}}, "unknown key adjustment.standards"),
        (ADJUSTMENT, {"levels": {"values": [1e-4, 2e-4]}}, "adjustment has low, high"),
        (ADJUSTMENT, {"catch": {"every": 5}}, "catch trials need a right answer"),
        (MATCHING, {"matching": {"standards": [1e-4, 1e-4]}}, "standards must be different"),
        (
            MATCHING,
            {"matching": {"standards": [0.0, 1e-4]}},
            "standards must be a finite number ab",
        ),
        (MATCHING, {"matching": {"standards": []}}, "matching needs matching.standards"),
        (MATCHING, {"stimuli": {"a": {}}}, "matching needs matching.standards"),
        (MATCHING, {"levels": None, "stimuli": {"a": {}}}, "matching needs [levels]"),
        (MATCHING, {"matching": {"coarse": 1}}, "coarse must lie between 2 and 100"),
    ],
)
def test_what_is_wrong_is_told_in_a_line(base, changes, told):
    with pytest.raises(AsperityError) as caught:
        design(base, **changes)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_standard_without_a_value_cannot_be_simulated():
    made = document(MATCHING, stimuli={"dots": {"scene": "probe-plate-dots"}})
    made["matching"].pop("standards")
    with pytest.raises(AsperityError, match=r"stimuli.dots.value is missing"):
        SimulatedInterface(design(made), "P1")
    assert expected_lines(design(made)) == []
