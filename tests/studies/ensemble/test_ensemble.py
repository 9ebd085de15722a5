"""Verdicts over an ensemble: the two questions, and the members that an audit found."""

import csv
import io
import json

import numpy as np
import pytest

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError
from asperity.studies.ensemble.members import EnsembleSettings, ensemble_hands
from asperity.studies.ensemble.questions import (
    PAPER_CLAIMS,
    PEOPLE_CLAIMS,
    constant_at_small,
    quadratic_fits,
    rises_at_largest,
)
from asperity.studies.ensemble.run import run_ensemble
from asperity.studies.ensemble.write import members_csv, summarise, tables, write_ensemble

HANDS = (Hand(), Hand(damping=10.0), Hand(0.2, 1000.0, 1.0))


@pytest.fixture(scope="module")
def result():
    settings = EnsembleSettings(
        hands=HANDS, amplitudes=(0.1e-3, 0.2e-3), heights=(0.4e-3,), seeds=(0,)
    )
    return run_ensemble(settings, processes=1)


def test_the_ensemble_has_the_hands_of_the_audit_and_the_default_one():
    hands = ensemble_hands()
    assert len(set(hands)) == 36
    for name, ends in (
        ("mass", (0.02, 0.2)), ("stiffness", (100.0, 1000.0)), ("damping", (1.0, 10.0)),
    ):  # fmt: skip
        values = [getattr(hand, name) for hand in hands]
        assert (min(values), max(values)) == ends
    assert Hand() in hands
    settings = EnsembleSettings()
    assert (min(settings.heights), max(settings.heights)) == (0.02e-3, 0.4e-3)
    assert (min(settings.amplitudes), max(settings.amplitudes)) == (0.02e-3, 0.4e-3)


def test_the_paper_has_nine_claims_and_one_cannot_fail():
    assert len(PAPER_CLAIMS) == 9
    assert [c.id for c in PAPER_CLAIMS if c.by_construction] == ["force.more_everywhere"]
    assert all(c.id != "speed.slower_at_small" for c in PAPER_CLAIMS)
    assert any(c.id == "speed.slower_at_small" for c in PEOPLE_CLAIMS)


def test_the_band_gets_every_claim_over_dots_with_the_default_hand_and_more_damping(result):
    answer = result.people
    band = answer.metrics.index("band_rms")
    for hand in HANDS[:2]:
        assert answer.of_hand(hand, answer.plates[0])[band].all()
    # A stiff, heavy, hardly damped hand is no such hand.
    assert not answer.of_hand(HANDS[2], answer.plates[0])[band].all()


def test_the_papers_metric_loses_the_place_of_the_peak_over_dots(result):
    own = result.people.of_hand(Hand(), result.people.plates[0])[0]
    ids = [claim.id for claim in PEOPLE_CLAIMS]
    assert not own[ids.index("diameter.peak_smaller_spacing")]
    assert not own[ids.index("speed.peak_moves_right")]


def test_the_default_hand_reproduces_the_paper_but_the_largest_spacing(result):
    own = dict(zip([c.id for c in PAPER_CLAIMS], result.paper.of_hand(
        Hand(), result.paper.plates[0])[0], strict=True))  # fmt: skip
    assert not own.pop("speed.faster_at_largest")
    assert all(own.values())


def test_shares_are_counted_from_members(result):
    rows = list(csv.DictReader(io.StringIO(members_csv(result))))
    about = summarise(result)
    for question in ("paper", "people"):
        for claim in about[question]["claims"]:
            for metric, share in claim["share"].items():
                mine = [
                    int(r["holds"]) for r in rows
                    if (r["question"], r["claim"], r["metric"]) == (question, claim["id"], metric)
                ]  # fmt: skip
                assert len(mine) == about[question]["members"]
                assert share == pytest.approx(np.mean(mine))
    assert about["paper"]["counted"] == 8
    assert about["people"]["counted"] == 7


def test_files_and_figures(result, tmp_path):
    write_ensemble(result, tmp_path)
    assert json.loads((tmp_path / "ensemble.json").read_text("utf-8"))["schema"] == 1
    text = "\n".join(tables(result))
    assert "by construction, not counted" in text
    assert "Default hand, b = 10 N s/m" in text
    for name in ("ensemble_claims", "ensemble_hands"):
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000


def test_processes_do_not_change_the_verdicts():
    settings = EnsembleSettings(
        hands=(Hand(),), amplitudes=(0.1e-3, 0.2e-3), heights=(), sinusoid_spacings=6
    )
    one, two = (run_ensemble(settings, processes=n) for n in (1, 2))
    assert np.array_equal(one.paper.holds, two.paper.holds)
    assert one.people.holds.shape[1] == 0


def test_rules_can_fail():
    spacing = np.geomspace(0.5e-3, 3.5e-3, 9)
    hill = np.exp(-((np.log(spacing / 1.3e-3)) ** 2))
    levels = np.stack([hill, 1.1 * hill, 1.2 * hill])
    assert quadratic_fits(spacing, levels).holds
    zigzag = levels * np.where(np.arange(9) % 2, 1.0, 3.0)
    assert not quadratic_fits(spacing, zigzag).holds
    assert rises_at_largest(spacing, levels).holds
    assert not rises_at_largest(spacing, levels[::-1]).holds
    assert not constant_at_small(spacing, levels).holds  # 18 %
    assert constant_at_small(spacing, levels[:2]).holds
    assert not constant_at_small(spacing, 0.0 * levels).holds


def test_bad_settings_are_refused():
    with pytest.raises(AsperityError, match="at least one hand"):
        EnsembleSettings(hands=())
    with pytest.raises(AsperityError, match=r"at least 5.*4"):
        EnsembleSettings(dot_spacings=4)
    with pytest.raises(AsperityError, match="processes must be at least 1, got 0"):
        run_ensemble(processes=0)
