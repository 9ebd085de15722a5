"""What is shipped of the ensemble is what the code gives, and what the documentation shows."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from asperity.drawing.figure_style import COLUMN_WIDTH, SMALLEST
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError
from asperity.studies.ensemble.figures import claims_figure, hands_figure
from asperity.studies.ensemble.members import EnsembleSettings
from asperity.studies.ensemble.processes import as_text, from_text, over_items
from asperity.studies.ensemble.run import run_ensemble
from asperity.studies.ensemble.stored import PUBLISHED, members_document, read_ensemble
from asperity.studies.ensemble.write import summarise
from figure_text import smallest_text

DOCS = Path(__file__).resolve().parents[3] / "docs"
ROOT = DOCS.parent


@pytest.fixture(scope="module")
def stored():
    return read_ensemble()


def test_what_is_shipped_spans_the_whole_ensemble(stored):
    settings = EnsembleSettings()
    for answer, plates in ((stored.paper, settings.sinusoids()), (stored.people, settings.dots())):
        assert answer.hands == settings.hands
        assert list(answer.plates) == plates


def test_some_members_judged_anew_are_as_shipped(stored):
    hands = (Hand(), Hand(0.2, 100.0, 10.0), Hand(0.02, 1000.0, 1.0))
    settings = EnsembleSettings(hands=hands, amplitudes=(0.1e-3,), heights=(0.2e-3,), seeds=(1,))
    anew = run_ensemble(settings, processes=1)
    for mine, shipped in ((anew.paper, stored.paper), (anew.people, stored.people)):
        for hand in hands:
            for plate in mine.plates:
                one, other = (answer.of_hand(hand, plate) for answer in (mine, shipped))
                np.testing.assert_array_equal(one, other)


def test_a_result_is_read_as_it_was_written(stored, tmp_path):
    path = tmp_path / "members.json"
    path.write_text(json.dumps(members_document(stored)), "utf-8")
    again = read_ensemble(path)
    for one, other in ((again.paper, stored.paper), (again.people, stored.people)):
        np.testing.assert_array_equal(one.holds, other.holds)
        assert one.metrics == other.metrics
    assert json.loads(PUBLISHED.read_text("utf-8")) == members_document(stored)


def test_other_claims_are_refused(stored, tmp_path):
    document = members_document(stored)
    document["people"]["holds"]["band_rms"].pop("force.peak_stays")
    path = tmp_path / "members.json"
    path.write_text(json.dumps(document), "utf-8")
    with pytest.raises(AsperityError, match=r"claims of band_rms are not those of this version"):
        read_ensemble(path)


def test_the_page_of_the_studies_has_these_shares(stored):
    page = (DOCS / "studies.md").read_text("utf-8")
    people = stored.people
    for j, claim in enumerate(people.claims):
        if not claim.by_construction:
            row = re.search(rf"^\| {claim.text} \|(.+)\|$", page, re.MULTILINE | re.IGNORECASE)
            assert row, claim.text
            shown = [int(cell.strip(" %*")) for cell in row[1].split("|")]
            assert shown == [round(100.0 * share) for share in people.shares[:, j]], claim.text
    paper = summarise(stored)["paper"]
    for claim in paper["claims"]:
        if not claim["by_construction"]:
            share = f"{100.0 * claim['share']['max_acceleration']:.0f} %"
            assert re.search(rf"\| (\*\*)?{share}(\*\*)?(;| \|)", page), claim["id"]
    counts = [f"{people.median_count(metric):g}" for metric in people.metrics]
    assert f"| **median member, of 7** | **{'** | **'.join(counts)}** |" in page


def test_the_readme_has_the_median_members(stored):
    readme = (ROOT / "README.md").read_text("utf-8")
    paper = stored.paper.median_count("max_acceleration")
    own, band = (stored.people.median_count(m) for m in ("max_acceleration", "band_rms"))
    assert f"{paper:g} of 8 claims" in readme
    assert f"**{own:g} of 7**" in readme
    assert f"**{band:g} of 7**" in readme


def test_letters_are_large_enough_in_a_column_of_the_documentation(stored):
    for draw in (claims_figure, hands_figure):
        figure = draw(stored)
        assert figure.get_figwidth() <= COLUMN_WIDTH
        points, text = smallest_text(figure)
        assert points >= SMALLEST, text


def test_verdicts_as_text():
    holds = np.random.default_rng(0).random((3, 4)) < 0.5
    np.testing.assert_array_equal(from_text(as_text(holds), (3, 4)), holds)
    with pytest.raises(AsperityError, match=r"12 characters of 0 and 1, got 3: '01x'"):
        from_text("01x", (3, 4))


def test_items_keep_their_order_and_are_counted():
    counted = []
    found = over_items(abs, [-3, 2, -1], processes=1, progress=lambda: counted.append(1))
    assert found == [3, 2, 1]
    assert len(counted) == 3
    assert over_items(abs, [], processes=2) == []
    with pytest.raises(AsperityError, match="processes must be at least 1, got 0"):
        over_items(abs, [1], processes=0)


def test_low_dots_hide_the_peak_and_the_others_do_not(stored):
    people = stored.people
    high = [i for i, plate in enumerate(people.plates) if plate.height >= 0.1e-3]
    low = [i for i, plate in enumerate(people.plates) if plate.height < 0.1e-3]
    shares = people.holds[:, :, people.metrics.index("band_rms")]
    peaks = [j for j, claim in enumerate(people.claims)
             if "peak" in claim.id or claim.id == "diameter.inverted_u"]  # fmt: skip
    found = 100.0 * shares[:, high][..., peaks].mean(axis=(0, 1))
    page = " ".join((DOCS / "studies.md").read_text("utf-8").split())
    assert f"about the peak in {found.min():.0f} to {found.max():.0f} % of the members" in page
    assert 100.0 * shares[:, low][..., peaks].mean() < found.min()
