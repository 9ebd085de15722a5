"""The demo and its page, on the generated stand-ins (measured files are not needed)."""

import re

import pytest

from asperity.cli.demo_pipeline import PROBES, SCENES, run_demo, steps
from asperity.cli.report import report_page
from asperity.studies.otaduy_lin_2004.real_surfaces import REAL_SURFACES
from asperity.studies.otaduy_lin_2004.studies import StudySettings
from asperity.viewer.pictures import PICTURED

SETTINGS = StudySettings(spacings=6)


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo")
    told = {"drags": 0, "rubs": 0, "ticks": 0}

    def count(what):
        told[what] += 1

    results = run_demo(
        folder, None, settings=SETTINGS,
        on_drag=lambda: count("drags"), on_rub=lambda: count("rubs"),
        on_ticks=lambda: count("ticks"),
    )  # fmt: skip
    return results, told


def test_progress_is_told_as_often_as_announced(demo):
    _, told = demo
    assert (told["drags"], told["rubs"], told["ticks"]) == steps(SETTINGS)


def test_the_page_is_self_contained_and_complete(demo):
    results, _ = demo
    page = report_page(results)
    links = re.findall(r"(?:src|href)=['\"]([^'\"]{0,30})", page)
    assert links
    assert all(link.startswith("data:") for link in links)
    assert page.count("<audio") == len(REAL_SURFACES)
    assert page.count("<img") == 4 + len(REAL_SURFACES) + 3 * len(SCENES) + len(PICTURED)
    for claim in results.claims:
        assert f"<code>{claim['id']}</code>" in page
    assert "How long it took" in page
    assert "chosen after the paper" in page


def test_each_scene_is_shown_with_its_figures(demo):
    results, _ = demo
    page = report_page(results)
    assert {scene.name for scene in SCENES} == set(results.runs)
    for plate in (4, 5, 6):
        assert f"(colour plate {plate})" in page
    for scene in SCENES:
        summary = results.runs[scene.name].summary
        depths = sum(summary["status"].values())
        assert summary["ticks"] == round(scene.seconds * 1e3) + 1
        assert summary["contacts"]["ticks_in_contact"] == summary["ticks"]
        assert f"certified: {summary['status']['certified']} of {depths} depths" in page
        assert summary["status"]["overflow"] == 0
        median, rare = results.tick_us[scene.name]
        assert 0.0 < median <= rare
        assert (results.folder / f"{scene.prefix}recording.h5").is_file()


def test_missing_surfaces_are_said_to_be_generated(demo):
    results, _ = demo
    for surface in REAL_SURFACES:
        assert results.remarks[surface.name].startswith("Generated")
        assert "Stand-in" in results.rubs[surface.name].attrs["title"]
    page = report_page(results)
    assert "<h2>Rough surfaces that stand in" in page
    assert "<h2>Real surfaces" not in page


def test_figures_of_claims_have_their_unit(demo):
    page = report_page(demo[0])
    cells = re.findall(r"<small>([\d. /]+)( m/s²)?</small></td>", page)
    assert len(cells) > 8
    assert any(unit for _, unit in cells)
    assert any(not unit for _, unit in cells)  # the threshold-weighted power has none


def test_larger_probes_shake_less_on_rough_ground(demo):
    results, _ = demo
    for data in results.rubs.values():
        assert list(data["diameter"].values) == list(PROBES)
        assert data["band_rms"].values[-1] < data["band_rms"].values[0]


def test_measured_surfaces_are_used_where_present(data):
    for surface in REAL_SURFACES:
        heights, remark = surface.load(data / "measured")
        assert remark.startswith("Measured")
        assert heights.samples.ndim == 2
