"""The page of the documentation, and the fit that is shipped: they agree with the code."""

import re
from pathlib import Path

import numpy as np
import pytest

from asperity.drawing.pages import filled
from asperity.errors import AsperityError
from asperity.studies.literature import fit as fits
from asperity.studies.literature.catalogue import FINDINGS, SEARCHED
from asperity.studies.literature.halves_page import read_published_halves
from asperity.studies.literature.hand_search import HELD_OUT, candidate_measures, sample_hands
from asperity.studies.literature.laboratory import Laboratory, Plan, judge_or_explain
from asperity.studies.literature.measures import PAPER
from asperity.studies.literature.page import DETAIL_FIGURES, FIGURES, value_text
from asperity.studies.literature.table import MARKS, judge_all, make_columns

DOCS = Path(__file__).resolve().parents[3] / "docs"


@pytest.fixture(scope="module")
def page():
    return (DOCS / "findings.md").read_text("utf-8")


@pytest.fixture(scope="module")
def details():
    return (DOCS / "findings_details.md").read_text("utf-8")


@pytest.fixture(scope="module")
def table(details):
    """Return the marks of each finding in the page's table, by id."""
    row = r"^\| `([\w.]+)` [^|]+\| [^|]+\| \w+(?:, by construction)? \| (.+) \|$"
    rows = re.findall(row, details, re.MULTILINE)
    return {name: marks.replace("*", "").split(" | ") for name, marks in rows}


def test_the_page_lists_the_findings_of_the_code(details, table):
    assert list(table) == [finding.id for finding in FINDINGS]
    for finding in FINDINGS:
        assert f"## {finding.title}\n" in details
        assert finding.criterion in details
        assert finding.people in details
        for marks in table.values():
            assert len(marks) == 5
            assert set(marks) <= set(MARKS.values())


def test_the_pages_have_their_figures(page, details):
    for text, names in ((page, FIGURES), (details, DETAIL_FIGURES)):
        assert re.findall(r"images/(\w+)\.png", text) == list(names)
        for name in names:
            assert (DOCS / "images" / f"{name}.png").stat().st_size > 10_000


def test_every_finding_has_its_source_and_how_surely_it_is_known(page):
    for finding in FINDINGS:
        row = re.search(rf"^\| \[?{re.escape(finding.title)}.*$", page, re.MULTILINE)
        assert row, finding.id
        for source in finding.sources:
            assert source.short in row[0], finding.id
        assert f"| {finding.sureness.name.lower()} |" in row[0], finding.id
        # In both columns of shares; a finger with skin cannot fail three more.
        assert (row[0].count("by construction") == 2) == finding.by_construction, finding.id


def test_the_page_agrees_with_the_fit_that_is_shipped(details):
    fit, words = fits.read_published_fit(), " ".join(details.split())
    assert f"{fit['chosen']['name']} with a hand of" in words
    assert f"**{fit['got']} of {fit['counted']}**" in words
    assert f"{fit['hands_as_good']['hands']} of {fit['hands']} hands" in words


def test_the_fit_that_is_shipped_is_of_this_code():
    fit = fits.read_published_fit()
    hand, measure = fits.chosen_design(fit)
    assert measure in candidate_measures()
    near = [np.isclose(h.mass, hand.mass) for h in sample_hands(fit["hands"], fit["seed"])]
    assert sum(near) == 1
    judged_ids = [f.id for f in SEARCHED if f.id != "grit.measured"]
    assert list(fit["holds"]) == judged_ids
    assert fit["counted"] == len([name for name in judged_ids if name not in HELD_OUT])
    assert fit["got"] == sum(fit["holds"][name] for name in judged_ids if name not in HELD_OUT)
    assert fit["got"] <= fit["most"]["got"] <= fit["counted"]


def test_the_pages_words():
    assert filled("one\ntwo\n\nthree") == "one two\n\nthree"
    assert value_text([1.23456, None, True]) == "[1.23, none, yes]"
    assert value_text([[1.0], [2.0]]) == "[1], [2]"


def test_what_cannot_be_simulated_is_said():
    def judge(lab, measure):
        raise AsperityError("the hand rests in a notch")

    finding = FINDINGS[0].__class__(**{**vars(FINDINGS[0]), "judge": judge})
    verdict = judge_or_explain(finding, Laboratory(), PAPER)
    assert verdict.holds is None
    assert "rests in a notch" in verdict.note


@pytest.mark.slow
def test_the_whole_table_comes_out_as_the_page_has_it(table):
    columns = make_columns(fits.chosen_design(fits.read_published_fit()))
    without = [finding for finding in FINDINGS if finding.id != "grit.measured"]
    rows, _ = judge_all(columns, findings=without, plan=Plan())
    for finding, verdicts in rows:
        assert [MARKS[verdicts[c.name].holds] for c in columns] == table[finding.id], finding.id


def test_the_halves_that_are_shipped_are_of_these_findings(page, details):
    halves, words = read_published_halves(), " ".join(page.split())
    ids = {finding.id for finding in FINDINGS}
    first, second = (set(halves["halves"][name]) for name in ("first", "second"))
    assert first.isdisjoint(second)
    assert first | second == set(halves["findings"]) <= ids
    assert len(halves["findings"]) >= 25
    assert halves["hands"] >= 36
    assert f"was taken: {halves['chosen']['name']}." in words
    held = halves["shares"]
    better = held["chosen"]["second"]["median"] > held["band"]["second"]["median"]
    assert ("never saw, the choice is no better than the band" in words) != better
    assert details.count("(held out);") == len(second)
