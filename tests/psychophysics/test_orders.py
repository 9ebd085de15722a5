"""Orders that are balanced over participants."""

import itertools
from collections import Counter

import numpy as np
import pytest
from fakes import CHOICE, MAGNITUDE, MATCHING, PAIRS, design

from asperity.errors import AsperityError
from asperity.psychophysics.procedures.orders import participant_number, williams
from asperity.psychophysics.procedures.procedures import procedure

BALANCED = {"order": "balanced"}


def trials_of(made, participant, session=1, answer=lambda trial: 1.0):
    steps, out = procedure(made, participant, session), []
    while (trial := steps.next()) is not None:
        out.append(trial)
        steps.answer(trial, answer(trial))
    return out


@pytest.mark.parametrize("count", [2, 3, 4, 5, 6, 7, 9, 10])
def test_a_williams_design_is_balanced_for_places_and_followers(count):
    rows = williams(count)
    times = len(rows) // count
    assert times == 1 + count % 2
    for row in rows:
        assert sorted(row) == list(range(count))
    for column in rows.T:
        assert Counter(column.tolist()) == dict.fromkeys(range(count), times)
    follows = Counter((a, b) for row in rows.tolist() for a, b in itertools.pairwise(row))
    assert follows == dict.fromkeys(itertools.permutations(range(count), 2), times)


def test_magnitudes_over_participants():
    made = design(MAGNITUDE, session=BALANCED, magnitude={"blocks": 2, "practice": 1})
    orders = {1: [], 2: []}
    for number in range(1, 11):  # five stimuli: ten rows
        trials = trials_of(made, f"P{number:02d}")
        for block, rows in orders.items():
            rows.append([t.stimuli[0].name for t in trials if t.block == block])
    for rows in orders.values():
        first = Counter(row[0] for row in rows)
        assert set(first.values()) == {2}
        follows = Counter((a, b) for row in rows for a, b in itertools.pairwise(row))
        assert len(follows) == 20
        assert set(follows.values()) == {2}
    # Another seed gives the places of the square to other stimuli.
    other = trials_of(design(MAGNITUDE, session=BALANCED, seed=8), "P01")
    assert [t.stimuli for t in other] != [t.stimuli for t in trials_of(made, "P01")]


@pytest.mark.parametrize(
    "method", [{}, {"forced_choice": {"intervals": 3}}, {"method": "odd-one-out"}]
)
def test_the_comparison_is_in_each_interval_equally_often(method):
    changes = dict(method)
    if "method" in changes:
        changes |= {"forced_choice": None, "odd_one_out": {**CHOICE["forced-choice"]}}
    made = design(CHOICE, session=BALANCED, staircase={"trials": 48}, **changes)
    count = made.forced_choice.intervals
    places = []
    for number in range(1, count + 1):
        trials = trials_of(made, f"A{number}", answer=lambda trial: trial.target)
        places.append([_single(trial) for trial in trials])
        assert set(Counter(places[-1]).values()) == {48 // count}
    for one_trial in zip(*places, strict=True):
        assert sorted(one_trial) == list(range(count))
    assert places[0] != [_single(t) for t in trials_of(made, "A1", 2, lambda trial: trial.target)]


def _single(trial):
    """Return the interval, from 0, whose value comes once; of two that of the comparison."""
    values = [stimulus.value for stimulus in trial.stimuli]
    if len(values) == 2:
        return int(np.argmax(values))
    return next(i for i, value in enumerate(values) if values.count(value) == 1)


def test_neighbouring_participants_have_pairs_in_opposite_orders():
    made = design(PAIRS, session=BALANCED, pairs={"repeats": 1})
    firsts = [
        {tuple(sorted(s.name for s in t.stimuli)): t.stimuli[0].name for t in trials_of(made, code)}
        for code in ("P1", "P2")
    ]
    assert len(firsts[0]) == 6
    assert all(firsts[0][pair] != firsts[1][pair] for pair in firsts[0])


def test_standards_of_a_matching():
    made = design(MATCHING, session=BALANCED, matching={"repeats": 2})
    rows = []
    for number in range(1, 7):
        trials = trials_of(made, f"P{number}", answer=lambda trial: 0)
        rows.append([t.stimuli[0].name for t in trials if t.block == 1])
    assert set(Counter(row[0] for row in rows).values()) == {2}


def test_a_code_without_a_number_has_no_place():
    assert (participant_number("P07"), participant_number("12")) == (6, 11)
    for code in ("TEST", "P0", "P1a"):
        with pytest.raises(AsperityError, match="codes that end in the number") as caught:
            procedure(design(MAGNITUDE, session=BALANCED), code, 1)
        assert "\n" not in str(caught.value)
