"""WAV files: pitch, length, loudness, and the stated gain."""

import numpy as np
import pytest
import xarray as xr
from scipy.io import wavfile

from asperity.errors import AsperityError
from asperity.runs.sound import PEAK, at_one_level, from_acceleration, from_run
from asperity.studies.otaduy_lin_2004.studies import StudySettings, run_study


def tone(frequency=100.0, amplitude=3.0, rate=8000.0, seconds=0.5):
    t = np.arange(int(rate * seconds)) / rate
    return amplitude * np.sin(2 * np.pi * frequency * t), 1.0 / rate


def test_a_tone_keeps_its_pitch_and_states_its_gain(tmp_path):
    sound = from_acceleration(*tone(), rate=44100)
    sound.write(tmp_path / "tone.wav")
    rate, samples = wavfile.read(tmp_path / "tone.wav")
    assert (rate, samples.dtype) == (44100, np.int16)
    assert samples.size == pytest.approx(0.5 * 44100, abs=2)
    spectrum = np.abs(np.fft.rfft(samples * np.hanning(samples.size)))
    assert np.argmax(spectrum) * rate / samples.size == pytest.approx(100.0, abs=2.1)
    # Full scale times the gain gives back the acceleration.
    assert np.max(np.abs(samples)) / 32767 == pytest.approx(PEAK, abs=1e-4)
    assert np.max(np.abs(sound.samples)) * sound.gain == pytest.approx(3.0, rel=1e-3)


def test_a_repeat_is_continued_without_a_seam():
    wave, step = tone(frequency=100.0, seconds=0.01)
    sound = from_acceleration(wave, step, seconds=1.0, repeats=True, rate=22050)
    spectrum = np.abs(np.fft.rfft(sound.samples * np.hanning(sound.samples.size)))
    near = np.abs(np.arange(spectrum.size) - 100) < 4
    assert np.max(spectrum[~near]) < 1e-3 * np.max(spectrum)


def test_what_the_rate_cannot_hold_is_filtered_not_folded():
    fast, step = tone(frequency=3000.0)
    slow, _ = tone(frequency=50.0, amplitude=1.0)
    sound = from_acceleration(fast + slow, step, rate=2000)
    spectrum = np.abs(np.fft.rfft(sound.samples * np.hanning(sound.samples.size)))
    folded = round(1000 * sound.samples.size / 2000)
    assert np.max(spectrum[folded - 4 :]) < 1e-2 * np.max(spectrum)


@pytest.fixture(scope="module")
def study():
    return run_study("speed", StudySettings(spacings=5), peaks=False)


def test_a_study_sounds_at_speed_over_spacing(study):
    sound = from_run(study, spacing=1.3e-3, level=1, seconds=1.0)
    spacing = study["spacing"].values[np.argmin(np.abs(np.log(study["spacing"] / 1.3e-3).values))]
    spectrum = np.abs(np.fft.rfft(sound.samples * np.hanning(sound.samples.size)))
    assert np.argmax(spectrum) % round(0.083 / spacing) < 3
    assert "speed 0.083 m/s" in sound.source


@pytest.mark.parametrize(
    ("options", "said"),
    [({"level": 3}, "between 0 and 2, got 3"), ({"rate": 10}, "rate.*10"),
     ({"spacing": -1.0}, "spacing.*-1.0"), ({"seconds": 0.0}, "seconds.*0.0")],
)  # fmt: skip
def test_bad_choices_are_named(study, options, said):
    with pytest.raises(AsperityError, match=said):
        from_run(study, **options)


def test_silence_and_foreign_files_are_refused():
    with pytest.raises(AsperityError, match="nothing to hear"):
        from_acceleration(np.zeros(100), 1e-3)
    with pytest.raises(AsperityError, match="no acceleration"):
        from_run(xr.Dataset({"x": 1}))


def test_sounds_to_compare_have_one_level():
    rng = np.random.default_rng(4)
    spiky = np.zeros(4000)
    spiky[::800] = 5.0
    waves = (tone(seconds=0.5)[0], 0.01 * rng.standard_normal(4000), spiky)
    sounds = [from_acceleration(wave, 1 / 8000.0) for wave in waves]
    equal = at_one_level(sounds)
    levels = [float(np.sqrt(np.mean(sound.samples**2))) for sound in equal]
    assert levels == pytest.approx([levels[0]] * 3, rel=1e-9)
    assert [sound.level for sound in equal] == pytest.approx([20 * np.log10(levels[0])] * 3)
    loudest = [float(np.max(np.abs(sound.samples))) for sound in equal]
    assert max(loudest) == pytest.approx(PEAK)
    # What full scale stands for still gives back the acceleration.
    for before, after in zip(sounds, equal, strict=True):
        np.testing.assert_allclose(after.samples * after.gain, before.samples * before.gain)
