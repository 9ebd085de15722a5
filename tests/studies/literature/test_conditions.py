"""Conditions: the drags behind the verdicts, against the studies and against geometry."""

import numpy as np
import pytest

from asperity.studies.literature.catalogue import FINDINGS, JUDGED_BY_METRIC
from asperity.studies.literature.finger import Finger
from asperity.studies.literature.laboratory import Laboratory, Plan
from asperity.studies.literature.measures import COLUMNS, PAPER, STILL
from asperity.studies.literature.plates import Dots, Paper
from asperity.studies.literature.table import (
    as_csv,
    as_json,
    count_findings,
    judge_all,
    make_columns,
)
from asperity.studies.otaduy_lin_2004.claims import evaluate_claims
from asperity.studies.otaduy_lin_2004.force_models.otaduy_lin import slope_table
from asperity.studies.otaduy_lin_2004.studies import StudySettings, run_study
from asperity.texture.patterns.random_surfaces import self_affine

PLAN = Plan(spacings=12)
CLAIMS = {
    "diameter.higher": "diameter.peak_higher",
    "diameter.smaller_spacing": "diameter.peak_smaller_spacing",
    "force.rougher": "force.more_everywhere",
    "force.place": "force.peak_stays",
    "speed.large": "speed.faster_rougher_at_large",
    "speed.small": "speed.slower_rougher_at_small",
    "speed.peak": "speed.peak_moves_right",
}


@pytest.fixture(scope="module")
def lab():
    return Laboratory(plan=PLAN, measures=tuple(COLUMNS.values()))


def test_the_seeds_findings_are_judged_as_the_studies_claims(lab):
    settings = StudySettings(spacings=PLAN.spacings)
    simulator = settings.simulator()
    studies = {
        name: run_study(name, settings, simulator=simulator)
        for name in ("diameter", "force", "speed")
    }
    claims = {claim["id"]: claim["holds"] for claim in evaluate_claims(studies)}
    seven = [finding for finding in FINDINGS if finding.id in CLAIMS]
    assert len(seven) == 7
    for finding in seven:
        for name, measure in COLUMNS.items():
            verdict = finding.judge(lab, measure)
            assert verdict.holds == claims[f"{CLAIMS[finding.id]}.{name}"], (finding.id, name)


def test_the_papers_metric_misses_speed_and_the_band_does_not(lab):
    small = next(f for f in FINDINGS if f.id == "speed.small")
    assert small.judge(lab, PAPER).holds is False
    assert small.judge(lab, COLUMNS["band_rms"]).holds is True


def test_a_path_between_dots_is_still(lab):
    plate = Dots(jitter=0.0, rows=2, columns=2, lines=2)
    paths = plate.surfaces(5e-3)
    assert [path.line for path in paths] == [0.0, 1.5 * 5.5e-3]
    missed, touched = lab.records(plate, 5e-3, PLAN.touch(probe=1e-3))
    assert touched.largest > 0.0
    assert missed is STILL


def test_a_finger_averages_over_its_contact():
    plate = Dots(lines=1).surfaces(1e-3)[0]
    wide, narrow = Finger(contact=8e-3), Finger(contact=0.2e-3, skin=3e-3, lines=1)
    u = np.linspace(0.0, plate.period, 4001)
    probe = slope_table(plate, 3e-3)(u)
    assert np.std(wide.slope_table(plate)(u)) < 0.1 * np.std(probe)
    # A contact of next to no width is a probe as wide as the skin's balls.
    assert np.std(narrow.slope_table(plate)(u)) == pytest.approx(np.std(probe), rel=0.2)


def test_a_paper_is_as_high_as_it_is_told_to_be(tmp_path):
    import imageio.v3 as iio

    heights = self_affine((40, 60), 9e-6, hurst=0.8, rms_slope=0.2, rolloff=1e-4, seed=1)
    levels = (heights - heights.min()) / np.ptp(heights) * 65535.0
    iio.imwrite(tmp_path / "paper.png", levels.round().astype(np.uint16))
    (surface,) = Paper(tmp_path / "paper.png", shape=(30, 50)).surfaces(1e-4)
    assert surface.samples.shape == (30, 50)
    assert 0.4e-4 < np.ptp(surface.samples) <= 1.0001e-4


def test_measured_papers_are_skipped_with_the_reason_where_they_are_not(lab):
    papers = next(f for f in FINDINGS if f.id == "grit.measured")
    verdict = papers.judge(lab, PAPER)
    assert verdict.holds is None
    assert "not available" in verdict.note


def test_measured_papers_are_judged_where_they_are(data, monkeypatch):
    papers = next(f for f in FINDINGS if f.id == "grit.measured")
    monkeypatch.setattr("asperity.studies.literature.conditions.RELIEFS", (0.3,))
    lab = Laboratory(plan=Plan(spacings=8, diameters=(3e-3,)), data=data / "measured")
    verdict = papers.judge(lab, COLUMNS["band_rms"])
    assert verdict.holds is True
    # At one relief, the order is the other way round: the answer is in the choice of relief.
    assert verdict.measured["coarse_over_fine_at_same_relief"][0] < 1.0


def test_a_finding_says_where_it_stands_and_how_sure_it_is():
    ids = [finding.id for finding in FINDINGS]
    assert len(set(ids)) == len(ids) == len(JUDGED_BY_METRIC) + 1
    for finding in FINDINGS:
        assert finding.sources
        for text in (finding.title, finding.people, finding.condition, finding.criterion):
            assert text
        assert finding.before == (finding.id not in CLAIMS)


def test_a_table_counts_what_was_judged(lab):
    chosen = [f for f in FINDINGS if f.id in ("speed.small", "grit.measured")]
    columns = make_columns((lab.hand, COLUMNS["band_rms"]))
    rows, labs = judge_all(columns, findings=chosen, plan=Plan(spacings=8))
    assert count_findings(rows, "max_acceleration") == (0, 1)
    assert count_findings(rows, "chosen") == (1, 1)
    assert labs["chosen"] is labs["band_rms"]
    lines = as_csv(rows, columns).splitlines()
    assert lines[0].endswith(
        "max_acceleration,max_abs_acceleration,band_rms,threshold_power,chosen"
    )
    assert lines[2].endswith("skipped,skipped,skipped,skipped,skipped")
    assert '"metric_after_the_fact": true' in as_json(rows, columns)
