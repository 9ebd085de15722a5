"""Half of the findings to choose on, half to judge on."""

import numpy as np

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.studies.ensemble import halves
from asperity.studies.literature.catalogue import FINDINGS
from asperity.studies.literature.measures import COLUMNS, PAPER
from asperity.studies.literature.plates import Dots


def test_what_counts_can_fail_and_is_no_other_finding_once_more():
    counted = {finding.id for finding in halves.counted_findings()}
    assert len(counted) >= 25
    assert {"force.rougher", "finger.force", "static.speed", "grit.measured"}.isdisjoint(counted)
    assert len(FINDINGS) >= 25


def test_the_halves_depend_on_names_alone_and_part_the_findings():
    ids = [finding.id for finding in halves.counted_findings()]
    first = halves.draw_halves(ids)
    assert abs(2 * first.sum() - len(ids)) <= 1
    turned = halves.draw_halves(ids[::-1])
    assert np.array_equal(turned[::-1], first)


def test_the_choice_looks_at_the_first_half_alone():
    rng = np.random.default_rng(0)
    rows = rng.random((40, 6, 10)) < 0.4
    first = np.arange(10) < 5
    rows[:, 3, :5] = True
    assert halves.choose_metric(rows, first) == 3
    other = rows.copy()
    other[:, :, 5:] = ~other[:, :, 5:]
    assert halves.choose_metric(other, first) == 3


def test_a_small_ensemble_from_drags_to_shares():
    names = ("diameter.higher", "speed.small", "speed.large", "force.place", "gratings.level")
    findings = tuple(f for f in halves.counted_findings() if f.id in names)
    measures = (PAPER, COLUMNS["band_rms"])
    table = halves.judge_ensemble(
        measures, hands=[Hand(), Hand(damping=10.0)], findings=findings,
        plates=(Dots(lines=2), Dots(height=0.2e-3, lines=1)), processes=1,
    )  # fmt: skip
    assert table.holds.shape == (2, 2, 2, 5)
    ids = [finding.id for finding in findings]
    # The seed's findings are judged over dots: there the band gets them, and max u'' does not.
    small = table.holds[:, 0, :, ids.index("speed.small")]
    assert small[:, 1].all()
    assert not small[:, 0].any()
    about = halves.summarise_halves(table)
    assert set(about["halves"]["first"]) | set(about["halves"]["second"]) == set(names)
    share = about["findings"]["speed.small"]
    assert share["paper"] == 0.0
    assert share["band"] == table.rows()[:, 1, ids.index("speed.small")].mean()
