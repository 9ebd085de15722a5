"""The table of docs/experiments.md: how often intervals of sessions have the truth in them.

pytest -m slow -s tests/psychophysics/test_coverage.py
"""

import numpy as np
import pytest
from fakes import CHOICE, design
from many_sessions import by_level, many_sessions, truth_of
from scipy.stats import binom

from asperity.psychophysics.analysis.psychometric import hits_by_level
from asperity.psychophysics.analysis.psychometric_fit import fall_of, fit_psychometric
from asperity.psychophysics.analysis.psychometric_search import QUANTITIES, LikelihoodSearch
from asperity.psychophysics.expected import expected_interval
from asperity.psychophysics.procedures.procedures import procedure

SESSIONS = 1000
SEED = 20040
"""Of the sessions of the table. Those by which `STRETCH` was chosen had others."""
PROPORTION = 0.8
LEVELS = [0.05, 0.0707, 0.1, 0.141, 0.2, 0.283, 0.4, 0.566, 0.8]
CONSTANT = {"forced_choice": {"adaptive": "constant"}, "staircase": None,
            "constant": {"levels": LEVELS}}  # fmt: skip
DESIGNS = {
    "staircase": {"staircase": {"start": [0.8, 0.8], "trials": 80}},
    "quest+": {"forced_choice": {"adaptive": "quest+"}, "staircase": None, "quest": {}},
    "constant": CONSTANT,
}  # fmt: skip
SIGNED = {
    "forced_choice": {"adaptive": "constant", "low": -0.6, "high": 0.6, "scale": "linear"},
    "staircase": None, "constant": {"levels": [-0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6]},
    "simulated": {"function": "normal"},
}  # fmt: skip
TRUTHS = [
    (0.2, 0.6, 0.02), (0.1, 0.6, 0.02), (0.3, 0.6, 0.02), (0.2, 0.4, 0.02), (0.2, 0.9, 0.02),
    (0.2, 0.6, 0.0),
]  # fmt: skip
"""Threshold, width, lapse."""
SIGNED_TRUTHS = [
    (0.0, 0.6, 0.02), (0.1, 0.6, 0.02), (-0.2, 0.6, 0.02), (0.0, 0.4, 0.02), (0.0, 0.9, 0.02),
    (0.0, 0.6, 0.0),
]  # fmt: skip


def made_of(name, intervals, truth, **more):
    sections = dict(SIGNED if name == "signed" else DESIGNS[name]) | more
    own = dict(zip(("threshold", "width", "lapse"), truth, strict=True))
    sections["simulated"] = sections.get("simulated", {}) | own
    if intervals == 3:
        sections["forced_choice"] = sections.get("forced_choice", {}) | {"intervals": 3}
    return design(CHOICE, **sections)


def coverage(made, sessions, seed):
    """Return the part of sessions whose interval has the truth in it, and the mean error."""
    levels, count, hits = by_level(*many_sessions(made, sessions, seed))
    settings, truth = made.forced_choice, truth_of(made)
    search = LikelihoodSearch(levels, count, settings.guess, truth.function, None, PROPORTION)
    best = search.best(hits)
    true = np.array([[truth.threshold, truth.width, truth.lapse]])
    top, inside, errors = search.likelihood(hits, best), {}, {}
    for quantity in QUANTITIES:
        # The truth is inside if the profile there has not fallen too far: no need to look for ends.
        value = search.of(quantity, true)
        fall = top - search.profile(hits, quantity, value)
        most = fall_of(0.95, settings.adaptive, quantity, guess=settings.guess)
        inside[quantity] = float(np.mean(fall < most))
        errors[quantity] = float(np.mean(search.of(quantity, best) - value))
    return inside, errors


ROWS = [(name, n, truth) for name in DESIGNS for n in (2, 3) for truth in TRUTHS]
ROWS += [("signed", 2, truth) for truth in SIGNED_TRUTHS]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "intervals", "truth"), ROWS)
def test_of_every_default_design(name, intervals, truth):
    made = made_of(name, intervals, truth)
    inside, errors = coverage(made, SESSIONS, [SEED, *map(int, 1000 * np.abs(truth)), intervals])
    off = errors["threshold"]
    percent = 100.0 * (10.0**off - 1.0 if made.forced_choice.scale == "log" else off)
    numbers = " | ".join(f"{100.0 * part:.1f}" for part in inside.values())
    print(f"| {name}, {intervals} | {', '.join(map(str, truth))} | {numbers} | {percent:+.1f} |")
    lower, upper = binom.ppf([0.001, 0.999], SESSIONS, [0.93, 0.97]) / SESSIONS
    for quantity, part in inside.items():
        assert part >= lower, quantity
        # Lapses of few trials take few values, and rates near 0 or 0.06 are at their bounds.
        if quantity != "lapse" or name == "staircase":
            assert part <= upper, quantity
    assert abs(percent) < 3.0


def test_of_some_sessions():
    inside, errors = coverage(made_of("constant", 3, TRUTHS[0]), 200, 1)
    assert min(inside.values()) >= binom.ppf(0.001, 200, 0.93) / 200
    assert abs(errors["threshold"]) < 0.02


def test_what_is_expected_of_a_design_narrows_with_its_trials():
    widths = []
    for repeats in (10, 60):
        made = made_of("constant", 2, TRUTHS[0], constant={"levels": LEVELS, "repeats": repeats})
        low, high = expected_interval(made, sessions=4)
        assert low < made.simulated.threshold < high
        widths.append(high / low)
    assert widths[1] < widths[0]


@pytest.mark.parametrize("intervals", [2, 3])
@pytest.mark.parametrize("name", DESIGNS)
def test_many_sessions_at_once_are_those_of_the_procedures(name, intervals):
    made = made_of(name, intervals, TRUTHS[0])
    x, hits = many_sessions(made, 3, 1)
    tracks = len(getattr(made.adaptive, "start", (0.0,)))
    for session in range(3):
        # The answers to each track, in their order.
        parts = zip(np.split(x[session], tracks), np.split(hits[session], tracks), strict=True)
        rows = [list(zip(*part, strict=True)) for part in parts]
        steps, presented = procedure(made, "P1", 1), []
        while (trial := steps.next()) is not None:
            row = rows[(trial.track or 1) - 1]
            if name == "constant":  # the order of levels is drawn
                at = next(i for i, (level, _) in enumerate(row) if level == trial.intensity)
                level, hit = row.pop(at)
            else:
                level, hit = row.pop(0)
            presented.append(trial.intensity)
            assert level == pytest.approx(trial.intensity, abs=1e-12)
            others = [i for i in range(1, intervals + 1) if i != trial.target]
            steps.answer(trial, trial.target if hit else others[0])
        assert len(presented) == x.shape[1]
        assert not any(rows)


def test_many_sessions_at_once_are_fitted_as_one_by_one():
    made, apart = made_of("staircase", 2, TRUTHS[0]), []
    x, hits = many_sessions(made, 12, 2)
    levels, count, hit = by_level(x, hits)
    search = LikelihoodSearch(levels, count, 0.5, "weibull", None, PROPORTION)
    best = search.best(hit)
    for i in range(12):
        own, number, right = hits_by_level(x[i], hits[i])
        alone = LikelihoodSearch(own, number, 0.5, "weibull", None, PROPORTION)
        at = alone.best(right[None])
        top = alone.likelihood(right, at)[0]
        assert search.likelihood(hit, best)[i] == pytest.approx(top, abs=1e-3)
        for quantity, value in (("threshold", -0.7), ("level", -0.65), ("width", 0.6),
                                ("slope", 1.0), ("lapse", 0.02)):  # fmt: skip
            value = np.array([value])
            one = alone.profile(right, quantity, value)[0]
            apart.append(abs(search.profile(hit, quantity, value)[i] - one))
    # Both start from grids, of which one may lead to another of several maxima.
    assert np.quantile(apart, 0.9) < 2e-3
    assert max(apart) < 0.15


def test_the_ends_of_an_interval_are_where_the_profile_has_fallen():
    made = made_of("staircase", 2, TRUTHS[0])
    x, hits = many_sessions(made, 4, 3)
    for session in range(4):
        fit = fit_psychometric(x[session], hits[session], samples=1, proportion=PROPORTION)
        own, number, right = hits_by_level(x[session], hits[session])
        search = LikelihoodSearch(own, number, 0.5, "weibull", None, PROPORTION)
        top = search.likelihood(right, search.best(right[None]))[0]
        for quantity in ("threshold", "level"):
            ends = np.array(getattr(fit, quantity))
            fallen = top - search.profile(right, quantity, ends)
            np.testing.assert_allclose(fallen, fall_of(0.95, "staircase", quantity), atol=0.05)
