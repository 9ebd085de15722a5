"""The parts that the paper leaves out, switched on and off over the ensemble."""

from pathlib import Path

import numpy as np
import pytest

from asperity.drawing.figure_style import COLUMN_WIDTH, SMALLEST
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.studies.ensemble.halves import counted_findings
from asperity.studies.ensemble.members import ensemble_hands
from asperity.studies.ensemble.parts import (
    PAIRS,
    by_finger,
    choose_design,
    designs,
    judge_parts,
    judged_findings,
    parts_document,
    parts_summary,
    read_parts,
)
from asperity.studies.ensemble.parts_figures import GROUPS, SHOWN, page_figures
from asperity.studies.literature.halves_page import read_published_halves
from asperity.studies.literature.page import FIGURES, page
from asperity.studies.literature.plates import Dots
from figure_text import smallest_text

DOCS = Path(__file__).resolve().parents[3] / "docs"


@pytest.fixture(scope="module")
def stored():
    return read_parts()


def test_what_is_shipped_spans_all_hands_findings_and_designs(stored):
    assert list(stored.hands) == ensemble_hands()
    assert stored.designs == designs()
    assert [one.id for one in stored.findings] == [one.id for one in judged_findings()]
    assert stored.holds.shape == (36, 3, len(designs()), len(judged_findings()))


def test_each_pair_switches_one_part_and_the_last_all():
    every = designs()
    for part, _, without, added in PAIRS[:-2]:
        one, other = every[without], every[added]
        changed = {
            "lift-off": one.lift_off != other.lift_off,
            "skin under the finger": one.skin != other.skin,
            "tissue from grip to skin": one.measure.transmission != other.measure.transmission,
            "saturating pooling": (one.measure.kind, other.measure.kind) == ("summed", "pooled"),
        }
        assert [name for name, is_other in changed.items() if is_other] == [part]
    last = every[PAIRS[-1][3]]
    assert last.lift_off
    assert last.skin
    assert last.measure.transmission
    assert last.measure.kind == "pooled"


def test_some_members_judged_anew_are_as_shipped(stored):
    hand, plate = Hand(0.02, 300.0, 10.0), stored.plates[1]
    names = ("speed.large", "speed.small", "finger.jitter", "sinusoids.descend")
    kept = tuple(one for one in stored.findings if one.id in names)
    tried = {name: designs()[name] for name in ("paper", "band", "band_lift", "pooled_tissue_skin")}
    anew = judge_parts(tried, hands=[hand], findings=kept, plates=(plate,), processes=1)
    at = stored.hands.index(hand)
    ids = [one.id for one in stored.findings]
    for name in tried:
        shipped = stored.of(name)[at, 1][[ids.index(one.id) for one in kept]]
        np.testing.assert_array_equal(anew.of(name)[0, 0], shipped, err_msg=name)


def test_without_parts_the_shares_are_those_of_the_halves(stored):
    halves = read_published_halves()
    for one, shares in halves["findings"].items():
        for design in ("paper", "band", "chosen"):
            assert stored.share(design, one) == pytest.approx(shares[design]), (one, design)


def test_a_part_leaves_alone_what_it_has_nothing_to_do_with(stored):
    ids = [one.id for one in stored.findings]
    for one in stored.findings:
        if not by_finger(one):
            k = ids.index(one.id)
            same = np.array_equal(stored.of("band")[..., k], stored.of("band_skin")[..., k])
            assert same, one.id
    alone = [i for i in ids if i.startswith("finger.") and i != "finger.line"]
    for name in alone:
        k = ids.index(name)
        assert np.array_equal(stored.of("band")[..., k], stored.of("band_lift")[..., k]), name


def test_what_the_model_cannot_fail_counts_for_nothing(stored):
    summary = parts_summary(stored)
    assert summary["counted"] == len(counted_findings()) == 27
    changed = stored.holds.copy()
    construction = [one.by_construction for one in stored.findings]
    changed[..., construction] = False
    other = type(stored)(stored.findings, stored.designs, stored.hands, stored.plates, changed)
    assert parts_summary(other)["median"] == summary["median"]


def test_a_finger_that_knows_no_speed_gets_no_credit_for_speed(stored):
    ids = [one.id for one in stored.findings]
    band, skin = (dict(zip(ids, stored.counts(n), strict=True)) for n in ("band", "band_skin"))
    free = {one for one in ids if band[one] and not skin[one]}
    assert free == {"finger.speed", "finger.groove_over_rate", "finger.textures"}
    for one in free:
        assert stored.share("band_skin", one) == 1.0  # it cannot fail them


def test_the_choice_of_a_model_looks_at_the_first_half_alone(stored):
    second = read_published_halves()["halves"]["second"]
    turned = stored.holds.copy()
    at = [one.id in second for one in stored.findings]
    turned[..., at] = ~turned[..., at]
    other = type(stored)(stored.findings, stored.designs, stored.hands, stored.plates, turned)
    mine, its = choose_design(stored), choose_design(other)
    assert mine["name"] == its["name"]
    assert mine["shares"]["band"]["second"] != its["shares"]["band"]["second"]


def test_a_table_is_read_as_it_was_written(stored, tmp_path):
    import json

    path = tmp_path / "parts.json"
    path.write_text(json.dumps(parts_document(stored)), "utf-8")
    np.testing.assert_array_equal(read_parts(path).holds, stored.holds)


def test_the_page_is_what_the_stored_results_give(stored):
    shown = (DOCS / "findings.md").read_text("utf-8")
    assert shown == page(parts_summary(stored), "images/")


def test_the_picture_has_every_finding_once_in_letters_large_enough(stored):
    drawn = [one for _, ids in GROUPS for one in ids]
    assert sorted(drawn) == sorted(one.id for one in stored.findings)
    assert {name for _, columns in SHOWN for name, _ in columns} <= set(stored.designs)
    figures = page_figures(stored)
    assert tuple(figures) == FIGURES
    for figure in figures.values():
        assert figure.get_figwidth() <= COLUMN_WIDTH
        points, text = smallest_text(figure)
        assert points >= SMALLEST, text


def test_a_small_ensemble_by_every_design():
    kept = tuple(one for one in judged_findings() if one.id in ("grit.generated", "speed.large"))
    table = judge_parts(hands=[Hand()], findings=kept, plates=(Dots(lines=1),), processes=1)
    assert table.holds.shape == (1, 1, len(designs()), 2)
    assert table.of("band").any()
