"""The demo and its page, on the generated stand-ins (measured files are not needed)."""

import html
import re

import numpy as np
import pytest
from scipy.io import wavfile

from asperity.cli.demo_pipeline import PROBES, SCENES, SOUND_PROBES, run_demo, steps
from asperity.cli.report import main_number, measured_text, report_page
from asperity.drawing import figure_style
from asperity.drawing.pages import data_uri
from asperity.studies.otaduy_lin_2004.real_surfaces import REAL_SURFACES
from asperity.studies.otaduy_lin_2004.studies import StudySettings
from asperity.viewer.browser import browser_tab, chromium
from asperity.viewer.pictures import PICTURED
from figure_text import misplaced_text, smallest_text, texts_of

SETTINGS = StudySettings(spacings=6)
UNITS = r"(mN m|N s/m|N/m|N|mm/s|m/s²|mm|ms|s|Hz|µm|kg|dB|%)"


@pytest.fixture(scope="module")
def figures():
    """Return every figure that the demo saves, by the path of its file."""
    return {}


@pytest.fixture(scope="module")
def demo(tmp_path_factory, figures):
    folder = tmp_path_factory.mktemp("demo")
    told = {"drags": 0, "rubs": 0, "ticks": 0}
    save = figure_style.save

    def count(what):
        told[what] += 1

    def keep(figure, *rest):
        paths = save(figure, *rest)
        figures.update({path: figure for path in paths})
        return paths

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figure_style, "save", keep)
        results = run_demo(
            folder, None, settings=SETTINGS,
            on_drag=lambda: count("drags"), on_rub=lambda: count("rubs"),
            on_ticks=lambda: count("ticks"),
        )  # fmt: skip
    return results, told


@pytest.fixture(scope="module")
def page(demo):
    return report_page(demo[0])


@pytest.fixture(scope="module")
def words(page, figures):
    return linear_text(page, figures)


@pytest.fixture(scope="module")
def tab(page, tmp_path_factory):
    """Return a browser's tab on the page, with all that can be opened open."""
    if chromium() is None:
        pytest.skip("no Chromium is installed")
    file = tmp_path_factory.mktemp("page") / "report.html"
    file.write_text(page, "utf-8")
    with browser_tab() as made:
        made.goto(f"file://{file}")
        made.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")
        yield made


def test_progress_is_told_as_often_as_announced(demo):
    _, told = demo
    assert (told["drags"], told["rubs"], told["ticks"]) == steps(SETTINGS)


def test_the_page_is_self_contained_and_complete(demo, page):
    results, _ = demo
    links = re.findall(r"(?:src|href)=['\"]([^'\"]{0,30})", page)
    assert links
    assert all(link.startswith(("data:", "#")) for link in links)
    assert page.count("<audio") == len(REAL_SURFACES) * len(SOUND_PROBES)
    # Three studies with one metric and with all, speed by another metric, models; two of the
    # ensemble; four of surfaces.
    assert page.count("<img") == 8 + 2 + 4 + 4 * len(SCENES) + len(PICTURED)
    for claim in results.claims:
        assert f"<code>{claim['id']}</code>" in page
    assert "How long it took" in page
    assert "chosen after the paper" in page


def test_scenes_come_first_then_real_surfaces_then_studies(page):
    assert re.findall(r'<section id="(\w+)">', page) == [
        "scenes", "surfaces", "studies", "live", "claims", "time",
    ]  # fmt: skip


def test_the_contents_list_leads_to_every_heading(page):
    nav = page[page.index("<nav") : page.index("</nav>")]
    targets = re.findall(r'href="#([\w-]+)"', nav)
    headed = re.findall(r'<(?:section|h3) id="([\w-]+)">', page)
    assert targets == headed
    assert page.count("<h3") + page.count("<h2") == len(headed)
    assert page.index("</nav>") < page.index("<section")


def test_text_in_figures_is_nine_points_large_as_made(figures, page):
    shown = [path for path in figures if data_uri(path) in page]
    assert set(shown) == set(figures)  # whatever is saved is shown
    for path, figure in figures.items():
        assert figure.get_figwidth() == figure_style.REPORT_WIDTH, path
        points, text = smallest_text(figure)
        assert points >= figure_style.SMALLEST, (path, text)


def test_no_text_in_figures_is_cut_off_or_lies_on_another(figures):
    assert {path.name: misplaced_text(figure) for path, figure in figures.items()} == {
        path.name: [] for path in figures
    }


@pytest.mark.parametrize("width", [700, 900, 1100, 1440])
def test_the_browser_shows_figures_no_smaller_than_made_and_scrolls_nothing(page, tab, width):
    tab.set_viewport_size({"width": width, "height": 900})
    assert tab.evaluate("window.innerWidth") == width
    sizes = tab.evaluate("[...document.querySelectorAll('figure img')].map(i => i.clientWidth)")
    overlong = tab.evaluate(
        "[...document.querySelectorAll('html, figure, section, table, td')]"
        ".filter(one => one.scrollWidth > one.clientWidth + 1 && one.clientWidth > 0)"
        ".map(one => one.tagName + ' ' + one.innerText.slice(0, 60))"
    )
    past = tab.evaluate(
        "[...document.querySelectorAll('section *')]"
        ".filter(one => one.getBoundingClientRect().right > window.innerWidth)"
        ".map(one => one.tagName + ' ' + one.innerText)"
    )
    assert len(sizes) == page.count("<img")
    assert min(sizes) >= 96.0 * figure_style.REPORT_WIDTH - 1.0
    assert (overlong, past) == ([], [])


def test_axes_in_figures_have_units(figures):
    assert figures
    for path, figure in figures.items():
        for axes in figure.axes:
            for axis in (axes.xaxis, axes.yaxis):
                if not axes.get_visible() or not axis.get_visible():
                    continue
                numbered = any(
                    tick.label1.get_visible() and re.search(r"\d", tick.label1.get_text())
                    for tick in axis.get_major_ticks()
                )
                label = axis.get_label().get_text()
                if numbered and label:
                    assert re.search(r"\[.+\]|over that", label), (path.name, label)


def linear_text(page, figures):
    """Return the words of a page in the order in which they are read, figures' words in place."""
    text = re.sub(r"(?s)<style>.*?</style>|<nav.*?</nav>|<code>.*?</code>", " ", page)
    for path, figure in figures.items():
        words = html.escape(" ; ".join(one.get_text() for one in texts_of(figure)))
        text = text.replace(f'src="{data_uri(path)}"', f"> {words} <br")
    text = re.sub(r'<img alt="[^"]*"', "<br", text)  # the caption, which follows
    return html.unescape(re.sub(r"<(?!/?dfn)[^>]*>", "", text).replace("\u202f", ""))


@pytest.mark.parametrize(
    ("symbol", "explained"),
    [
        ("u''", "<dfn>u''"), ("u", "<dfn>u</dfn>"), ("R²", "<dfn>R²"), ("RMS", "<dfn>RMS"),
        ("Fu", "<dfn>Fu"), ("m", "mass m"), ("k", "stiffness k"), ("b", "damping b"),
        ("x", "<dfn>x"), ("y", "<dfn>y"), ("z", "<dfn>z"), ("[OL]", "<dfn>[OL]"),
        ("tick", "<dfn>tick"), ("certified", "<dfn>certified"),
    ],
)  # fmt: skip
def test_no_symbol_comes_before_its_explanation(symbol, explained, words):
    text = re.sub(rf"(?<=[\d.]) ?{UNITS}(?!\w)|\[{UNITS}\]", " ", words)
    first = re.search(rf"(?<![\w'<]){re.escape(symbol)}(?![\w'²])", text)
    assert explained in text
    assert text.index(explained) <= first.start(), text[first.start() - 60 : first.start() + 20]


def test_no_letter_stands_for_something_that_is_not_explained(words):
    text = re.sub(r"</?dfn>", "", words)
    text = re.sub(r"\[[^\]]*\]", " ", text)  # units
    text = re.sub(rf"(?<=[\d.]) ?{UNITS}(?![\w])", " ", text)
    letters = set(re.findall(r"(?<![\w'’.])[A-Za-zα-ω](?![\w'’.])", text))
    # An inverted U is a shape.
    assert letters - {"a", "A", "U"} == {"u", "x", "y", "z", "m", "k", "b"}
    assert "mass m" in text
    assert "stiffness k" in text
    assert "damping b" in text


def test_what_is_drawn_raised_is_said_to_be_and_why(page):
    assert re.search(r"raised by its penetration depth, since[\w\s]+hide the\s+contact", page)


def test_sounds_have_one_level_and_it_is_said(demo, page):
    results, _ = demo
    rms, loudest = [], []
    for path in sorted(results.folder.glob("*.wav")):
        _, samples = wavfile.read(path)
        rms.append(np.sqrt(np.mean((samples / 32767.0) ** 2)))
        loudest.append(np.abs(samples).max() / 32767.0)
    assert len(rms) == len(REAL_SURFACES) * len(SOUND_PROBES)
    assert rms == pytest.approx([rms[0]] * len(rms), rel=1e-3)
    assert 0.8 < max(loudest) < 1.0
    level = f"{20 * np.log10(rms[0]):.1f}".replace("-", "−")
    assert re.search(rf"at one level, an\s+RMS of\s+{level} dB", page)


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
        assert f"<td>{summary['status']['certified']} of {depths} (" in page
        assert summary["status"]["overflow"] == 0
        median, rare = results.tick_us[scene.name]
        assert 0.0 < median <= rare
        assert (results.folder / f"{scene.prefix}recording.h5").is_file()


def test_missing_surfaces_are_said_to_be_generated(demo):
    results, _ = demo
    for surface in REAL_SURFACES:
        assert results.remarks[surface.name].startswith("Stand-in made by code")
        assert results.rubs[surface.name].attrs["title"] == f"{surface.title} (stand-in)"
    page = report_page(results)
    assert "<h2>Stand-ins for real surfaces" in page
    assert "<h2>Real surfaces" not in page


def test_numbers_of_claims_have_their_unit(demo):
    for claim in demo[0].claims:
        if claim["id"].rsplit(".", 2)[1] in ("peak_higher", "faster_rougher_at_large"):
            unit = "(dimensionless)" if claim["id"].endswith("threshold_power") else "m/s²"
            assert main_number(claim).endswith(unit)
        for part in measured_text(claim).split("; "):
            if not part.startswith(("R²", "ratio", "least ratio")):
                assert part.endswith(("mm", "N", "mm/s", "%", "m/s²", "(dimensionless)")), part


def test_numbers_of_claims_show_their_verdict(demo):
    for claim in demo[0].claims:
        text = main_number(claim).replace("\u202f", "")
        numbers = [float(x) for x in re.findall(r"-?\d+\.?\d*", text.replace("R²", ""))]
        name = claim["id"].rsplit(".", 2)[1]
        if name == "quadratic":
            assert claim["holds"] == all(number >= 0.9 for number in numbers)
        if name == "more_everywhere":
            assert claim["holds"] == all(number > 1.0 for number in numbers)
        if name == "constant_at_small":
            assert claim["holds"] == (numbers[-1] <= 15.0)
        if name.startswith("faster_rougher"):
            assert claim["holds"] == (numbers == sorted(set(numbers)))


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
