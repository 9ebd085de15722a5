"""Predictions: what is published is what its hash and the code have."""

import json
from pathlib import Path

import pytest

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.studies.ensemble.predictions import content_hash, document, page, predict
from asperity.studies.literature.measures import COLUMNS, PAPER

FOLDER = Path(__file__).resolve().parents[3] / "docs" / "predictions"
MEASURES = {"paper": PAPER, "band": COLUMNS["band_rms"]}


@pytest.fixture(scope="module")
def rows():
    return predict(MEASURES, hands=[Hand()], seeds=(10,))


def test_every_kind_of_contrast_is_there_with_an_interval(rows):
    names = [row["contrast"] for row in rows]
    assert len(set(names)) == len(names) == 12 + 6 + 3 + 6
    for row in rows:
        for values in row["log10_ratio"].values():
            assert values["low"] <= values["median"] <= values["high"]
            assert 0.0 <= values["share_above_0"] <= 1.0


def test_force_enters_as_a_factor(rows):
    # Eq. 6: three times the force, three times the metric, but for the hand's lag.
    for row in rows:
        if row["contrast"].startswith("force"):
            assert row["log10_ratio"]["band"]["median"] == pytest.approx(0.477, abs=0.06)


def test_the_same_seed_gives_the_same_document(rows):
    about = {"date": "2026-01-01", "fitted": {"paper": "nothing"}, "version": "0"}
    one = document(rows, MEASURES, **about)
    other = document(predict(MEASURES, hands=[Hand()], seeds=(10,)), MEASURES, **about)
    assert one == other
    assert one["sha256"] == content_hash(one)
    changed = json.loads(json.dumps(one))
    changed["predictions"][0]["log10_ratio"]["paper"]["median"] += 0.001
    assert content_hash(changed) != one["sha256"]
    assert one["sha256"] in page(one)


def test_what_is_published_has_not_been_changed():
    files = sorted(FOLDER.glob("*.json"))
    assert files
    for file in files:
        found = json.loads(file.read_text("utf-8"))
        assert found["date"] == file.stem
        assert content_hash(found) == found["sha256"]
        assert file.with_suffix(".md").read_text("utf-8") == page(found)
        assert set(found["fitted_on"]) == set(found["metrics"])
