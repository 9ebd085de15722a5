"""A recording as CSV, WAV and PNG, and the motion of a tool as accelerations."""

import io

import numpy as np
import pytest
from PIL import Image
from scipy.io import wavfile

from asperity.cli.main import main
from asperity.errors import AsperityError
from asperity.runs import export, tool_motion
from asperity.runs.dataset import open_recording
from asperity.runs.recording import RecordingWriter

RATE, SPEED = 1000.0, 0.05
WAVE = {"x": (2e-6, 90.0), "z": (1e-6, 200.0)}
"""Amplitude [m] and frequency [Hz] of how the tool shakes."""


def columns(ticks=4000, left_out=()):
    time = np.delete(np.arange(ticks), left_out) / RATE
    n = len(time)
    pose = np.zeros((n, 7))
    pose[:, 0], pose[:, 3] = SPEED * time, 1.0
    for i, axis in ((0, "x"), (2, "z")):
        size, frequency = WAVE[axis]
        pose[:, i] += size * np.sin(2.0 * np.pi * frequency * time)
    wrench = np.zeros((n, 6))
    wrench[:, 2] = 0.5 + 0.1 * np.sin(2.0 * np.pi * 90.0 * time)
    return {
        "time": time, "handle_pose": pose, "tool_pose": pose, "contact_wrench": wrench,
        "device_wrench": -wrench, "contact_count": np.ones(n), "flags": np.zeros(n),
        "penetration_depth": np.full(n, 2e-4),
    }  # fmt: skip


@pytest.fixture
def recording(tmp_path):
    folder = tmp_path / "felt"
    folder.mkdir()
    with RecordingWriter(folder / "recording.h5", {"scene": "a plate", "dt": 1e-3}) as writer:
        writer.add_rows(columns())
    return folder


def accelerated(axis):
    size, frequency = WAVE[axis]
    return size * (2.0 * np.pi * frequency) ** 2


def test_accelerations_are_those_of_the_motion_also_where_ticks_are_missing():
    left_out = np.random.default_rng(1).choice(np.arange(2, 3998), 200, replace=False)
    said = columns(left_out=left_out)
    found = tool_motion.accelerations(said["time"], said["tool_pose"][:, :3])
    true = -accelerated("x") * np.sin(2.0 * np.pi * 90.0 * said["time"])
    apart = (found[1:-1, 0] - true[1:-1]) / accelerated("x")
    assert np.sqrt(np.mean(apart**2)) < 0.08
    along = tool_motion.along_motion(said["time"], said["tool_pose"][:, :3], found)
    np.testing.assert_allclose(along[50:-50], found[50:-50, 0], atol=0.02 * accelerated("x"))


def test_one_wave_has_the_power_of_all_axes():
    said = columns()
    found = tool_motion.accelerations(said["time"], said["tool_pose"][:, :3])
    wave = tool_motion.one_signal(found)
    centred = found - found.mean(axis=0)
    assert np.sum(wave**2) == pytest.approx(np.sum(centred**2), rel=1e-9)
    frequency, amplitude = tool_motion.joint_spectrum(found, 1.0 / RATE)
    assert np.sum(amplitude**2) / 2.0 == pytest.approx(np.mean(np.sum(centred**2, 1)), rel=0.03)
    two = np.sort(frequency[np.argsort(amplitude)[[-1, -4]]])
    np.testing.assert_allclose(two, (90.0, 200.0), atol=1.0)


def test_roughness_is_the_studies_metrics_of_the_motion():
    said = columns()
    found = tool_motion.roughness(said["time"], said["tool_pose"][:, :3], band=(20.0, 400.0))
    rms = np.hypot(accelerated("x"), accelerated("z")) / np.sqrt(2.0)
    # A millisecond's second difference holds 0.88 of 200 Hz, the band 0.97 of both.
    assert found.band_rms == pytest.approx(rms, rel=0.15)
    assert found.max_along == pytest.approx(accelerated("x"), rel=0.05)
    assert found.speed == pytest.approx(SPEED, rel=0.05)
    assert tool_motion.roughness(np.zeros(3), np.zeros((3, 3))) == (0.0, 0.0, 0.0)


def test_times_that_begin_anew_are_two_stretches():
    time = np.concatenate([np.arange(10), np.arange(5)]) * 1e-3
    assert tool_motion.last_run(time) == 10
    shown = tool_motion.traces(time, np.zeros((15, 3)), np.zeros((15, 6)), np.zeros(15))
    assert len(shown.time) == 5


def test_thinned_lines_keep_every_spike():
    draw = np.random.default_rng(2)
    time, values = np.arange(10_001) * 1e-3, draw.normal(size=(10_001, 2))
    values[7777, 0], values[3333, 1] = 50.0, -60.0
    at, drawn = tool_motion.thinned(time, values, 300)
    assert len(at) == len(drawn) == 300
    assert np.all(np.diff(at) >= 0.0)
    assert drawn[:, 0].max() == 50.0
    assert drawn[:, 1].min() == -60.0


def test_csv_has_units_in_its_header_and_every_tick(recording):
    with open_recording(recording) as data:
        text = export.csv_bytes(data)
        depth = data.penetration_depth.values
    head = text.split(b"\n", 1)[0].decode().split(",")
    assert head[0] == "time [s]"
    assert {"contact_force_z [N]", "tool_orientation_w [1]", "penetration_depth [m]"} <= set(head)
    table = np.genfromtxt(io.BytesIO(text), delimiter=",", skip_header=1)
    assert table.shape == (4000, len(head)) == (4000, 30)
    np.testing.assert_allclose(table[:, head.index("penetration_depth [m]")], depth)
    np.testing.assert_allclose(table[:, 0], np.arange(4000) / RATE)


@pytest.mark.parametrize("rate", [44100, 48000])
def test_wav_has_the_tones_and_no_images_of_them(recording, rate):
    with open_recording(recording) as data:
        sound = export.sound_of(export.traces_of(data), rate=rate)
    found, samples = wavfile.read(io.BytesIO(export.wav_bytes(sound)))
    assert found == rate
    assert len(samples) / rate == pytest.approx(4.0, abs=0.01)
    spectrum = np.abs(np.fft.rfft(samples * np.hanning(len(samples))))
    at = np.arange(len(spectrum)) * rate / len(samples)
    assert at[np.argmax(spectrum)] == pytest.approx(200.0, abs=0.5)
    assert spectrum[at > 600.0].max() < 0.01 * spectrum.max()
    # Full scale times the gain is the acceleration.
    peak = np.abs(samples).max() / 32767 * sound.gain
    assert accelerated("z") * 0.8 < peak < accelerated("x") + accelerated("z")


def test_the_command_leaves_all_files(recording, tmp_path, capsys):
    out = tmp_path / "out"
    assert (
        main(["export", str(recording), "--start", "1", "--seconds", "2", "--out", str(out)]) == 0
    )
    told = capsys.readouterr().out
    assert {file.name for file in out.glob("[!.]*")} == {
        "recording.csv", "acceleration.wav", "traces.png", "spectrum.png",
    }  # fmt: skip
    assert "2000 ticks" in told
    assert "full scale" in told
    for name in ("traces.png", "spectrum.png"):
        picture = np.asarray(Image.open(out / name).convert("L"))
        assert picture.std() > 10.0


def test_a_motion_that_could_not_yield_is_said_to_have_no_texture(tmp_path, capsys):
    for coupling, hand in (("direct", "none"), ("implicit", "none"), ("direct", "simulated")):
        folder = tmp_path / f"{coupling}-{hand}"
        folder.mkdir()
        attributes = {"scene": "a plate", "dt": 1e-3, "coupling": coupling, "hand": hand}
        with RecordingWriter(folder / "recording.h5", attributes) as writer:
            writer.add_rows(columns())
        for kind in ("csv", "wav"):
            out = ["--kinds", kind, "--out", str(folder / kind)]
            assert main(["export", str(folder), *out]) == 0
            stiff = (coupling, hand, kind) == ("direct", "none", "wav")
            assert ("contain no texture" in capsys.readouterr().out) == stiff


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["none.h5"], "no such recording"),
        (["felt", "--start", "9"], "no ticks from 9 s on: the recording goes from 0 to 3.999 s"),
        (["felt", "--kinds", "mp3"], "csv"),
    ],
)
def test_bad_input_is_told_in_one_line_and_leaves_nothing(
    recording, arguments, told, monkeypatch, capsys
):
    monkeypatch.chdir(recording.parent)
    assert main(["export", *arguments]) == 2
    said = capsys.readouterr().err
    assert told in said
    assert said.count("\n") == 1
    assert not (recording.parent / "out").exists()


def test_too_little_is_refused(recording):
    with open_recording(recording) as data, pytest.raises(AsperityError, match="too few"):
        export.traces_of(export.part_of(data, 3.995))
