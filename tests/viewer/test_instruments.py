"""The instruments in a real browser, on the ticks of a loop without a loop."""

import http.client
import io
import time

import numpy as np
import pytest
from scipy.io import wavfile

pytest.importorskip("viser", reason="needs viser (asperity[view])")
from fake_client import FREQUENCY, RATE, SHAKE, FakeServoClient

from asperity.errors import AsperityError
from asperity.runs.dataset import open_recording
from asperity.viewer.app import instrument_panels
from asperity.viewer.browser import browser_tab
from asperity.viewer.server.server import Page

SLOW = 180_000
"""Software graphics on a busy machine [ms]."""


@pytest.fixture(scope="module")
def tab():
    try:
        with browser_tab((760, 600)) as tab:
            yield tab
    except AsperityError as reason:
        pytest.skip(str(reason))


@pytest.fixture(scope="module")
def live(tab, tmp_path_factory):
    """A page on a client whose ticks come as time goes by, open in the tab."""
    folder = tmp_path_factory.mktemp("recordings")
    with FakeServoClient() as servo:
        servo.give(3.0)
        shown, panels = instrument_panels(servo, folder)
        with Page(shown, panels, port=0) as page:
            # Where the processor draws, all else waits for it.
            panel(page, "PlotsPanel")._often.value = "1 a second"
            tab.goto(page.url, timeout=SLOW)
            tab.get_by_role("tab", name="Plots").wait_for(timeout=SLOW)
            yield servo, page


def plots(tab):
    """Return what the browser draws: for each plot, x and its lines."""
    said = tab.evaluate(
        "Object.values((window.__viserTestpoints || {}).uplots || {})"
        ".map(p => [p.chart.series.map(s => s.label), p.chart.data.map(d => Array.from(d))])"
    )
    return [(labels, [np.array(line, dtype=float) for line in data]) for labels, data in said]


def until(true, seconds=120.0):
    """Wait until something is so; return it."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = true()
        if found:
            return found
        time.sleep(0.1)
    raise AssertionError(f"not within {seconds:g} s")


def drawn(tab):
    """Return the plots once all five show something."""

    def all_of_them():
        found = plots(tab)
        return found if len(found) == 5 and all(len(d[0]) > 50 for _, d in found) else None

    return until(all_of_them)


def press(tab, name, exact=True):
    tab.get_by_role("button", name=name, exact=exact).first.click(timeout=SLOW)


def to(tab, name):
    tab.get_by_role("tab", name=name).click(timeout=SLOW)


def panel(page, kind):
    return next(one for one in page.panels if type(one).__name__ == kind)


def test_plots_show_what_the_loop_says(live, tab):
    to(tab, "Plots")
    force, torque, shaking, depth, spectrum = (data for _, data in drawn(tab))
    assert force[0][0] >= -5.0
    assert force[0][-1] <= 0.0
    assert np.abs(force[1]).max() == pytest.approx(0.2, rel=0.02)
    np.testing.assert_allclose(force[3], 0.6)
    assert np.abs(torque[2]).max() == pytest.approx(5.0, rel=0.02)
    amplitude = SHAKE * (2.0 * np.pi * FREQUENCY) ** 2
    assert np.abs(shaking[1]).max() == pytest.approx(amplitude, rel=0.05)
    assert depth[1].max() == pytest.approx(0.15, rel=0.02)
    assert depth[1].min() == pytest.approx(0.05, rel=0.04)
    assert spectrum[0][np.argmax(spectrum[2])] == pytest.approx(FREQUENCY, abs=3.0)
    marked = spectrum[0][spectrum[1] > 0.0]
    assert marked.min() == pytest.approx(20.0, abs=4.0)
    assert marked.max() == pytest.approx(200.0, abs=4.0)


def test_the_predicted_roughness_is_that_of_the_shaking(live, tab):
    to(tab, "Plots")
    card = tab.locator('[data-asperity="roughness"]')
    until(lambda: "mm/s" in card.inner_text())
    text = card.inner_text()
    band = float(text.split("m/s²")[0])
    rms = SHAKE * (2.0 * np.pi * FREQUENCY) ** 2 / np.sqrt(2.0)
    assert band == pytest.approx(rms, rel=0.15)  # the band's filter lets 97 % through here
    assert "80 mm/s" in text
    assert "band metric" in text


def test_held_the_page_stands_and_follows_its_slider(live, tab):
    servo, page = live
    timeline = panel(page, "TimePanel")._timeline
    to(tab, "Plots")
    if not timeline.is_live:  # where this test failed before
        press(tab, "Back to now")
        until(lambda: timeline.is_live)
    press(tab, "Pause")
    held, ticks = until(lambda: timeline.length), servo.ticks
    until(lambda: timeline.at == held)
    slider = tab.locator(".mantine-Slider-trackContainer:visible").first
    slider.wait_for(timeout=SLOW)
    box = slider.bounding_box(timeout=SLOW)
    tab.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    until(lambda: 0.2 * held < timeline.at < 0.8 * held)
    # All that the page shows is of that instant: the pose, and the end of what is plotted.
    begun = timeline.everything()["time"][0]
    until(lambda: abs(page.servo.latest().time - begun - timeline.at) <= 2e-3)
    snapshot, at = page.servo.latest(), timeline.at
    assert snapshot.tool_pose[0] == pytest.approx(0.08 * snapshot.time, abs=1e-5)
    until(lambda: tab.get_by_text(f"{at:.3f} of").count())
    assert timeline.window(1.0)["time"][-1] == snapshot.time
    until(lambda: plots(tab)[0][1][0][0] == pytest.approx(max(-5.0, -at), abs=0.02))
    assert servo.ticks > ticks  # the loop went on
    assert timeline.length == held
    press(tab, "Back to now")
    until(lambda: timeline.is_live)


def test_the_sound_in_the_page_has_the_length_that_was_asked_for(live, tab):
    to(tab, "Record")
    until(lambda: live[0].ticks > 5.5 * RATE)
    press(tab, "Make a clip of what is shown")
    tab.locator("audio").wait_for(timeout=SLOW)
    length = until(lambda: tab.evaluate("document.querySelector('audio').duration || 0"))
    _, page = live
    wanted = panel(page, "SoundPanel")._length.value
    assert wanted == "5 s"
    # The browser decodes it: what it says is what it could play.
    assert length == pytest.approx(5.0, abs=0.1)
    assert tab.evaluate("document.querySelector('audio').error") is None


def test_what_is_recorded_is_what_is_replayed(live, tab):
    servo, page = live
    to(tab, "Record")
    recording = panel(page, "RecordPanel")
    came = []
    press(tab, "Record")
    until(lambda: recording._recorder is not None)
    end = servo.subscribe(came.append)
    time.sleep(2.0)
    press(tab, "Stop")
    path = until(lambda: recording.path, 60.0)
    end()
    kept = open_recording(path)
    assert kept.sizes["time"] > 1500
    assert kept.attrs["scene"] == "probe-plate"
    assert (path.parent / "scene" / "scene.toml").is_file()
    ticks = np.concatenate(came)
    # It began a little before we did, and ended with us or before.
    first = np.searchsorted(ticks["tool_pose"][:, 0], kept.tool_position[-500, 0].item())
    np.testing.assert_array_equal(
        kept.contact_force[-500:-400].values, ticks["contact_wrench"][first : first + 100, :3]
    )
    press(tab, "Replay")
    timeline = panel(page, "TimePanel")._timeline
    until(lambda: timeline.playing)
    timeline.playing = False
    timeline.move_to(1.0)
    to(tab, "Plots")
    message = until(lambda: tab.get_by_text("1.000 of").count())
    assert message
    snapshot = page.servo.latest()
    i = int(np.searchsorted(kept.time.values, kept.time.values[0] + 1.0 + 1e-9)) - 1
    np.testing.assert_array_equal(snapshot.tool_pose[:3], kept.tool_position[i].values)
    np.testing.assert_array_equal(snapshot.device_wrench[:3], kept.device_force[i].values)
    until(lambda: len(plots(tab)[0][1][0]) > 50)

    def matches():
        force = plots(tab)[0][1]
        return np.isclose(force[1].max(), kept.contact_force[: i + 1, 0].max(), rtol=1e-6)

    until(matches)
    press(tab, "Back to now")
    kept.close()


@pytest.mark.parametrize(
    ("button", "kind"), [("WAV of", "wav"), ("CSV,", "csv"), ("PNG of the plots", "png")]
)
def test_what_is_shown_can_be_taken_away(live, tab, button, kind):
    to(tab, "Record")
    folder = tab.get_by_text("Download what is shown")
    last = tab.get_by_role("button", name=button).last
    if not last.is_visible():
        folder.click(timeout=SLOW)
    with tab.expect_download(timeout=SLOW) as coming:
        last.click(timeout=SLOW)
    name, content = coming.value.suggested_filename, coming.value.path().read_bytes()
    assert name.startswith("probe-plate")
    if kind == "wav":
        rate, samples = wavfile.read(io.BytesIO(content))
        assert rate == 44100
        assert len(samples) > 2 * rate
    elif kind == "csv":
        head = content.split(b"\n")[0].decode().split(",")
        assert "contact_force_z [N]" in head
        table = np.loadtxt(io.BytesIO(content), delimiter=",", skiprows=1)
        np.testing.assert_allclose(table[:, head.index("contact_force_z [N]")], 0.6)
    else:
        assert content[:8] == b"\x89PNG\r\n\x1a\n"


def test_no_other_origin_is_answered(live):
    _, page = live
    connection = http.client.HTTPConnection("127.0.0.1", page.server.get_port(), timeout=10)
    connection.request("GET", "/", headers={"Origin": "http://elsewhere.example"})
    assert connection.getresponse().status == 403
    connection.close()
