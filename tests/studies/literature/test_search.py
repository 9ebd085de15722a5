"""The search: its design, its choice among ties, its bootstrap and profile, on made-up tables."""

import json
from dataclasses import replace

import numpy as np
import pytest

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError
from asperity.studies.literature import fit as fits
from asperity.studies.literature.catalogue import SEARCHED
from asperity.studies.literature.finding import Verdict
from asperity.studies.literature.hand_search import (
    RANGES,
    SearchResult,
    bootstrap,
    candidate_measures,
    choose,
    draw_conditions,
    find_neighbours,
    most_findings,
    parameter_values,
    profile_counts,
    sample_hands,
    search,
)
from asperity.studies.literature.laboratory import Plan
from asperity.studies.literature.measures import COLUMNS, PAPER, Measure

BAND = COLUMNS["band_rms"]


def test_hands_fill_their_ranges_and_come_again():
    hands = sample_hands(32)
    assert hands == sample_hands(32)
    assert hands != sample_hands(32, seed=1)
    for name, (low, high) in RANGES.items():
        values = parameter_values(hands, name)
        assert low <= values.min() < 1.3 * low
        assert high / 1.3 < values.max() <= high


@pytest.mark.parametrize("count", [0, 1, 3, 100])
def test_a_design_wants_a_power_of_two(count):
    with pytest.raises(AsperityError, match="power of 2"):
        sample_hands(count)


def test_no_metric_is_tried_twice_and_the_studies_are_among_them():
    tried = candidate_measures()
    assert len({m.name for m in tried}) == len(tried)
    assert set(COLUMNS.values()) <= set(tried)


def test_the_choice_gets_most_and_prefers_what_others_do_well_with():
    near = np.array([[0, 1], [1, 2], [2, 1], [3, 0]])
    holds = np.zeros((4, 2, 5), dtype=bool)
    holds[0, 0] = True  # All five, but its metric and its neighbours get nothing.
    holds[1, 1, :4] = holds[2, 1, :4] = holds[3, 1, :3] = holds[0, 1, :2] = True
    best = choose(holds, np.ones(5), near)
    assert best[:2] in {(1, 1), (2, 1)}
    assert best.got == 4
    assert most_findings(holds, np.ones(5)) == (0, 0, 5)
    assert choose(holds, np.array([0.0, 0.0, 0.0, 0.0, 1.0]), near)[:2] == (0, 0)


def test_neighbours_are_near_in_the_logarithm():
    hands = [Hand(0.02, 100.0, 1.0), Hand(0.4, 4000.0, 20.0), Hand(0.021, 100.0, 1.0)]
    hands += [Hand(0.03, 100.0 * 1.1**i, 1.0) for i in range(4)]
    near = find_neighbours(hands)
    assert near.shape == (7, 5)
    assert near[:, 0].tolist() == list(range(7))
    assert near[0, 1] == 2
    assert 1 not in near[0]


def test_a_bootstrap_sees_a_choice_that_was_luck():
    rng = np.random.default_rng(1)
    luck = rng.random((40, 20, 14)) < 0.5
    near = np.arange(40)[:, None]
    found = bootstrap(luck, near, rounds=100, fixed={"fixed": luck[0, 0]})
    assert np.mean(found.drawn) > 0.6
    assert np.mean(found.left_out) < 0.6
    assert np.mean(found.left_out_lucky) < 0.6
    sure = np.zeros((4, 3, 14), dtype=bool)
    sure[2, 1, :12] = True
    found = bootstrap(
        sure, np.arange(4)[:, None], rounds=100, fixed={"none": np.zeros(14, dtype=bool)}
    )
    assert set(found.choices) == {(2, 1)}
    assert np.mean(found.left_out) == pytest.approx(12 / 14, abs=0.05)
    assert set(found.left_out_of["none"]) == {0.0}


def test_held_out_conditions_are_others_and_come_again():
    one, again, two = draw_conditions(1), draw_conditions(1), draw_conditions(2)
    assert one == again
    assert one.plan.diameters != two.plan.diameters
    for plan in (one.plan, two.plan):
        for levels in (plan.diameters, plan.forces, plan.speeds):
            assert list(levels) == sorted(levels)


def test_a_profile_is_the_best_in_each_part():
    values, edges = np.array([1.0, 2.0, 20.0]), np.array([1.0, 10.0, 100.0, 1000.0])
    assert profile_counts(values, np.array([3, 5, 4]), edges) == [5, 4, None]


@pytest.fixture(scope="module")
def searched():
    """Return a real search, of the findings that need sinusoids alone."""
    findings = [f for f in SEARCHED if f.id.startswith(("speed", "force", "passive"))]
    hands = [Hand(), Hand(0.2, 500.0, 5.0)]
    return search(hands, (PAPER, BAND), findings=findings, plan=Plan(spacings=8))


def test_metrics_taken_all_at_once_judge_as_they_do_alone(searched):
    alone = search(searched.hands[:1], (BAND,), findings=searched.findings, plan=Plan(spacings=8))
    assert np.array_equal(searched.holds[:1, 1:], alone.holds)
    ids = [finding.id for finding in searched.findings]
    small = ids.index("speed.small")
    assert searched.holds[0, :, small].tolist() == [False, True]


def test_a_hand_that_cannot_be_dragged_gets_nothing():
    def judge(lab, measure):
        if lab.hand.mass > 0.1:
            raise AsperityError("the hand meets too many asperities")
        return Verdict(True, {})

    finding = replace(SEARCHED[0], judge=judge)
    result = search([Hand(mass=0.2), Hand()], (PAPER,), findings=[finding])
    assert result.holds[:, 0, 0].tolist() == [False, True]
    assert result.failed == [0]


def test_a_fit_is_plain_json_and_gives_its_choice_back(searched):
    default = SearchResult(
        [Hand()],
        tuple(COLUMNS.values()),
        searched.findings,
        np.ones((1, len(COLUMNS), len(searched.findings)), dtype=bool),
        [],
    )
    fit = fits.summarise(searched, default, others=0)
    again = json.loads(json.dumps(fit, allow_nan=False))
    hand, measure = fits.chosen_design(again)
    assert hand in searched.hands
    assert measure in searched.measures
    assert again["got"] == sum(again["holds"].values())
    peak = Measure(signal="force", power=np.inf)
    again["chosen"]["metric"] = json.loads(json.dumps(fits.as_json(peak)))
    assert fits.chosen_design(again)[1] == peak
