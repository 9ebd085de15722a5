"""The commands do what they say, from options to files."""

import contextlib
import json
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from scipy.io import wavfile

from asperity import __version__
from asperity.cli import main
from asperity.cli.doctor import timer_jitter

QUICK = ["--spacings", "6", "--diameters-mm", "2", "3"]


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"asperity {__version__}\n"


def test_a_study_leaves_figures_data_and_claims(tmp_path, capsys):
    out = tmp_path / "out"
    options = ["--amplitude-mm", "0.05", "--hand.mass-kg", "0.1", "--metric", "band_rms"]
    assert main(["study", "diameter", *QUICK, *options, "--out", str(out)]) == 0
    names = {path.name for path in out.glob("[!.]*")}
    assert names == {
        "diameter.png", "diameter.svg", "diameter_metrics.png", "diameter_metrics.svg",
        "diameter.nc", "claims.json",
    }  # fmt: skip
    with xr.open_dataset(out / "diameter.nc", engine="h5netcdf") as data:
        assert (data.attrs["amplitude"], data.attrs["hand_mass"]) == (0.05e-3, 0.1)
        np.testing.assert_allclose(data["diameter"], [2e-3, 3e-3])
    claims = json.loads((out / "claims.json").read_text("utf-8"))["claims"]
    held = [claim["holds"] for claim in claims if claim["counted"]]
    assert f"{sum(held)} of {len(held)} claims of the paper reproduce" in capsys.readouterr().out


def test_the_same_command_gives_the_same_numbers(tmp_path):
    for name in ("a", "b"):
        arguments = ["study", "force", *QUICK, "--surface", "dots", "--seed", "7"]
        assert main([*arguments, "--out", str(tmp_path / name)]) == 0
    texts = [(tmp_path / name / "claims.json").read_text("utf-8") for name in ("a", "b")]
    assert texts[0] == texts[1]


def test_a_run_becomes_a_sound_with_its_gain(tmp_path, capsys):
    study, out = tmp_path / "study", tmp_path / "sound"
    assert main(["study", "speed", *QUICK, "--out", str(study)]) == 0
    arguments = ["sound", str(study / "speed.nc"), "--spacing-mm", "1.5", "--seconds", "0.5"]
    assert main([*arguments, "--out", str(out)]) == 0
    rate, samples = wavfile.read(out / "sound.wav")
    facts = json.loads((out / "sound.json").read_text())
    assert rate == facts["rate_hz"] == 44100
    assert samples.size == pytest.approx(0.5 * rate, abs=2)
    assert f"{facts['full_scale_m_per_s2']:.3g} m/s²" in capsys.readouterr().out


def test_doctor_names_everything_it_should(capsys):
    assert main(["doctor"]) == 0
    said = capsys.readouterr().out
    for subject in ("asperity", "python", "numba", "compiled cache", "bytecode", "graphics",
                    "timer jitter", "priority", "devices"):  # fmt: skip
        assert subject in said


def test_jitter_is_measured_against_the_deadlines_not_the_sleeps():
    now = [0.0]

    def sleep(seconds):
        now[0] += seconds + 50e-6

    late = timer_jitter(clock=lambda: now[0], sleep=sleep, ticks=10)
    np.testing.assert_allclose(late, 50e-6, atol=1e-12)


@pytest.mark.parametrize(
    ("stopped_in", "told"),
    [
        ("taking", "nothing unfinished was kept"), ("closing the browser", "is written"),
        ("closing", "is written"),
    ],
)  # fmt: skip
def test_whoever_stops_a_picture_of_the_page_is_told_whether_there_is_one(
    stopped_in, told, tmp_path, monkeypatch, capsys
):
    pytest.importorskip("viser")
    import asperity.viewer.app
    import asperity.viewer.browser
    import asperity.viewer.servo_client

    @contextlib.contextmanager
    def linked(config):
        yield SimpleNamespace(config=config)

    @contextlib.contextmanager
    def shown(*_, **__):
        yield None
        raise KeyboardInterrupt

    def take(_, path):
        if stopped_in == "taking":
            raise KeyboardInterrupt
        path.write_bytes(b"PNG")
        if stopped_in == "closing the browser":
            raise KeyboardInterrupt

    monkeypatch.setattr(asperity.viewer.browser, "require_browser", lambda: "chromium")
    monkeypatch.setattr(asperity.viewer.browser, "take_picture", take)
    monkeypatch.setattr(asperity.viewer.servo_client, "ServoClient", linked)
    monkeypatch.setattr(asperity.viewer.app, "live_page", shown)
    picture = tmp_path / "page.png"
    assert main(["view", "--screenshot", str(picture), "--out", str(tmp_path / "view")]) == 130
    assert told in capsys.readouterr().err
    assert picture.exists() == (stopped_in != "taking")
