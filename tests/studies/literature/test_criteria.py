"""Criteria on made-up curves: each can be met, and each can be missed."""

import json

import numpy as np
import pytest

from asperity.studies.literature import criteria

X = np.geomspace(0.5e-3, 3.5e-3, 20)


def hump(place, height=1.0, width=0.6):
    """Return an inverted U in log-log."""
    return height * np.exp(-((np.log(X / place) / width) ** 2))


def humps(places, heights=(1.0, 1.0, 1.0), width=0.6):
    return np.array([hump(p, h, width) for p, h in zip(places, heights, strict=True)])


FALLING = (3.0, 2.0, 1.0)
RISING = (1.0, 2.0, 3.0)
MOVING = (1.0e-3, 1.3e-3, 1.7e-3)
STAYING = (1.3e-3, 1.3e-3, 1.31e-3)
LEAVING = (1.0e-3, 1.5e-3, 5e-3)
FLAT = np.ones((3, X.size))

CASES = [
    (criteria.peaks_fall_with, humps(MOVING, FALLING), True),
    (criteria.peaks_fall_with, humps(MOVING, RISING), False),
    (criteria.peaks_fall_with, humps(LEAVING, FALLING), False),
    (criteria.peaks_move_right, humps(MOVING), True),
    (criteria.peaks_move_right, humps(MOVING[::-1]), False),
    (criteria.peaks_move_right, humps(STAYING), False),
    (criteria.peaks_move_right, humps(LEAVING), False),
    (criteria.peaks_stay, humps(STAYING), True),
    (criteria.peaks_stay, humps(MOVING), False),
    (criteria.peaks_stay, FLAT, False),
    (criteria.rises_everywhere, humps(STAYING, RISING, 3.0), True),
    (criteria.rises_everywhere, humps(MOVING), False),
    (criteria.rises_at_large, humps(MOVING), True),
    (criteria.rises_at_large, humps(MOVING[::-1]), False),
    (criteria.falls_at_small, humps(MOVING), True),
    (criteria.falls_at_small, FLAT, False),
    (criteria.inverted_u, humps(MOVING), True),
    (criteria.inverted_u, 1.0 / humps(MOVING), False),
    (criteria.inverted_u, humps((5e-3,) * 3), False),
    (criteria.inverted_u, np.zeros_like(FLAT), False),
]


@pytest.mark.parametrize(("rule", "curves", "holds"), CASES)
def test_a_rule_on_levels_can_be_met_and_missed(rule, curves, holds):
    assert rule(X, curves).holds is holds


def test_a_top_lies_between_samples():
    top = criteria.maximum_of(X, hump(1.234e-3, 2.0))
    assert top.inside
    assert top.spacing == pytest.approx(1.234e-3, rel=1e-6)
    assert top.value == pytest.approx(2.0, rel=1e-6)
    assert not criteria.maximum_of(X, X).inside


DROPS = np.array([1.2, 1.5, 1.7, 1.6, 2.0, 2.4]) * 1e-3
INSIDE = np.ones(6, dtype=bool)


def test_peaks_follow_their_drop_points_or_not():
    assert criteria.follows(0.8 * DROPS, DROPS, INSIDE).holds is True
    assert criteria.follows(0.8 * DROPS, DROPS, INSIDE).measured["slope"] == pytest.approx(1.0)
    assert not criteria.follows(0.8 * DROPS, DROPS, ~INSIDE).holds
    assert criteria.follows(np.full(6, 1.5e-3), DROPS, INSIDE).holds is False
    assert not criteria.follows(DROPS[::-1], DROPS, INSIDE).holds


def test_peaks_lie_near_or_above_their_drop_points_or_not():
    assert criteria.near(0.8 * DROPS, DROPS, INSIDE).holds
    assert not criteria.near(0.7 * DROPS, DROPS, INSIDE).holds
    assert not criteria.near(DROPS, DROPS, ~INSIDE).holds
    assert criteria.above(1.1 * DROPS, DROPS, INSIDE).holds
    assert not criteria.above(0.9 * DROPS, DROPS, INSIDE).holds


def test_a_grating_levels_or_falls_or_never_rose():
    levelled = np.minimum(X / 1e-3, 1.2)
    assert criteria.rises_then_levels(X, levelled).holds
    assert not criteria.rises_then_levels(X, hump(1.2e-3)).holds
    assert not criteria.rises_then_levels(X, np.ones_like(X)).holds


def test_a_finger_is_a_line_and_a_probe_is_not():
    line, probe = X**0.7, hump(1.3e-3)
    assert criteria.linear_against_quadratic(X, line, probe).holds
    assert not criteria.linear_against_quadratic(X, probe, probe).holds
    assert not criteria.linear_against_quadratic(X, line, line).holds
    assert not criteria.linear_against_quadratic(X, 1.0 / line, probe).holds
    assert not criteria.linear_against_quadratic(X, line, np.zeros_like(X)).holds


def test_grits_are_ordered_or_not():
    assert criteria.ordered(np.array([[3.0, 2.0, 1.0], [5.0, 2.0, 1.5]])).holds
    assert not criteria.ordered(np.array([[3.0, 2.0, 1.0], [1.0, 2.0, 1.5]])).holds
    assert not criteria.ordered(np.array([2.0, 2.0])).holds


def test_one_effect_is_stronger_than_another():
    assert criteria.stronger(1.2, 1.0).holds
    assert not criteria.stronger(1.0, 1.0).holds
    assert not criteria.stronger(0.0, 0.0).holds
    assert criteria.size_of_effect(np.array([X, 2.0 * X])) == pytest.approx(np.log(2.0))


def test_what_was_measured_is_plain_json():
    assert criteria.plain(np.array([[1.0, np.nan], [2.0, np.inf]])) == [[1.0, None], [2.0, None]]


def test_a_verdict_is_plain_json_whichever_way_it_comes_out():
    verdicts = [rule(X, curves) for rule, curves, _ in CASES]
    for rule in (criteria.follows, criteria.near, criteria.above):
        verdicts += [rule(0.8 * DROPS, DROPS, INSIDE), rule(DROPS[::-1], DROPS, ~INSIDE)]
    verdicts += [
        criteria.rises_then_levels(X, X),
        criteria.linear_against_quadratic(X, X, hump(1e-3)),
        criteria.ordered(np.array([[2.0, 1.0]])),
        criteria.stronger(1.0, 2.0),
    ]
    for verdict in verdicts:
        assert type(verdict.holds) is bool
        json.dumps(verdict.measured, allow_nan=False)
