"""Live sound: from ticks to the samples for a sound card, with a stand-in for the card."""

import sys

import numpy as np
import pytest
from fake_client import FREQUENCY, RATE, SHAKE, FakeServoClient, ticks_at

from asperity.errors import AsperityError
from asperity.viewer import live_sound
from asperity.viewer.live_sound import DELAY, AccelerationSound, LiveSound, SampleRing

AMPLITUDE = SHAKE * (2.0 * np.pi * FREQUENCY) ** 2 / np.sqrt(3.0)
"""Of the sum of the axes over root three [m/s^2]; one of them shakes."""


class Card:
    """A sound card that requests samples when the test says so."""

    def __init__(self, *, samplerate, channels, dtype, callback):
        self.rate, self.channels, self.callback = samplerate, channels, callback
        self.said = []

    def start(self):
        self.said.append("start")

    def stop(self):
        self.said.append("stop")

    def close(self):
        self.said.append("close")

    def ask(self, seconds):
        out = np.full((round(seconds * self.rate), self.channels), np.nan, np.float32)
        self.callback(out, len(out), None, None)
        return out


def heard(servo, sound, seconds, every=1 / 60):
    """Let the loop and the card go on together."""
    return np.concatenate(
        [(servo.give(every), sound._stream.ask(every))[1] for _ in range(round(seconds / every))]
    )


@pytest.fixture
def servo():
    return FakeServoClient()


@pytest.mark.parametrize("lumps", [7, 16, 100])
def test_a_shaking_is_a_tone_whatever_the_lumps_it_comes_in(lumps):
    ticks = ticks_at(0, 2000)
    maker = AccelerationSound(RATE)
    wave = np.concatenate(
        [maker.samples(part) for part in np.split(ticks, range(0, 2000, lumps))[1:]]
    )
    assert len(wave) == pytest.approx(2.0 * 48_000, abs=0.01 * 48_000)
    steady = wave[24_000:]
    spectrum = np.abs(np.fft.rfft(steady * np.hanning(len(steady))))
    peak = np.argmax(spectrum) * 48_000 / len(steady)
    assert peak == pytest.approx(FREQUENCY, abs=1.0)
    # The second difference of 1 ms holds (sin x / x)^2 of it, the high-pass nearly all.
    x = np.pi * FREQUENCY / RATE
    assert np.max(np.abs(steady)) == pytest.approx(AMPLITUDE * (np.sin(x) / x) ** 2, rel=0.02)
    # No mirror image about the tick rate.
    image = spectrum[round(900 * len(steady) / 48_000)]
    assert image < 0.01 * spectrum.max()


def test_ticks_left_out_are_bridged_and_a_new_beginning_is_silent():
    maker = AccelerationSound(RATE)
    ticks = np.delete(ticks_at(0, 1000), slice(500, 502), axis=0)
    wave = maker.samples(ticks)
    # Of a straight way of two ticks amid a wave comes no more than a wave's own curvature.
    assert np.max(np.abs(wave[12_000:])) < 12.0 * AMPLITUDE
    begun_anew = ticks_at(0, 1000)
    begun_anew["time"] += 50.0
    after = maker.samples(begun_anew)
    assert np.max(np.abs(after)) < 3.0 * AMPLITUDE  # the way in between is no acceleration


def test_the_card_gets_the_tone_limited_and_in_time(servo):
    sound = LiveSound(servo, full_scale=2.0 * AMPLITUDE, open_stream=Card)
    out = heard(servo, sound, 2.0)
    assert sound._stream.rate == 48_000
    assert np.all(np.isfinite(out))
    np.testing.assert_array_equal(out[:, 0], out[:, 1])
    first = np.flatnonzero(out[:, 0])[0] / 48_000
    assert first == pytest.approx(DELAY, abs=0.03)
    steady = out[48_000:, 0]
    assert np.max(np.abs(steady)) == pytest.approx(np.tanh(0.5), rel=0.05)
    assert np.count_nonzero(steady) > 0.99 * len(steady)
    assert sound.delay < live_sound.MAX_DELAY
    sound.full_scale = 1e-3
    loud = heard(servo, sound, 0.2)
    assert np.max(np.abs(loud)) <= 1.0
    assert sound.limited > 0.05
    sound.close()
    assert sound._stream.said == ["start", "stop", "close"]
    assert servo._subscribers == []


def test_when_the_loop_stands_there_is_silence_and_when_the_card_does_nothing_piles_up(servo):
    sound = LiveSound(servo, open_stream=Card)
    heard(servo, sound, 0.5)
    assert np.all(sound._stream.ask(1.0)[-24_000:] == 0.0)
    for _ in range(300):  # 5 s in which the card asks for nothing
        servo.give(1 / 60)
    assert sound._ring.waiting <= live_sound.RATE
    out = sound._stream.ask(1 / 60)
    assert np.any(out != 0.0)
    assert sound.delay < live_sound.MAX_DELAY
    sound.close()


def test_a_ring_loses_nothing_but_what_has_no_room():
    ring, written, read = SampleRing(100), [], []
    draw = np.random.default_rng(3)
    n = 0
    for _ in range(400):
        new = np.arange(n, n + draw.integers(0, 60), dtype=float)
        written.extend(new[: ring.write(new)])
        n += len(new)
        out = np.zeros(draw.integers(0, 60), np.float32)
        read.extend(out[: ring.read(out)])
    assert read == written[: len(read)]
    assert len(written) - len(read) == ring.waiting


def test_without_a_sound_card_it_says_so_in_a_line(servo, monkeypatch):
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    assert "sounddevice" in LiveSound.missing()
    with pytest.raises(AsperityError, match="sounddevice"):
        LiveSound(servo)

    def refuses(**_):
        raise RuntimeError("Invalid\nsample rate")

    with pytest.raises(AsperityError, match=r"refuses: Invalid sample rate$"):
        LiveSound(servo, open_stream=refuses)
    assert servo._subscribers == []
