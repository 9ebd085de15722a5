"""The tool's acceleration, live, through the computer's own sound.

    rows of the loop --> acceleration at even steps --> without slow motion --> 48 kHz --> ring
    ring --> level --> the sound card, which asks for it in a thread of its own

What makes the sound is called with rows by the thread that fetches them for the page, and what
hands it on by the sound card's; they share a ring without a lock, one writing and one reading. The
loop knows of neither. Of the three axes the sum is heard, over root three: the one way of making
one of them that needs no look ahead, at the price that what is equal and opposite on two of them
is not heard.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.realtime.servo.tick_row import slices

if TYPE_CHECKING:
    from asperity.viewer.servo_client import ServoClient

RATE = 48_000
"""Samples of the sound a second."""
LOWEST = 20.0
"""What is slower [Hz] is the way, not the texture; and no loudspeaker's."""
DELAY = 0.07
"""So much is kept ready [s]: rows come 60 times a second, in lumps."""
MOST = 0.20
"""What comes to lie further behind [s] is left out."""
_INNER = (500, 1000, 2000, 3000, 4000, 6000, 8000, 12_000, 24_000)
"""Steps a second that 48 kHz is a whole multiple of."""
_TAPS = 16
"""Of the low-pass, in steps."""
_POSITION = slice(slices()["tool_pose"].start, slices()["tool_pose"].start + 3)
_RESTART = 0.1
"""A gap in time [s] after which the motion is taken to begin anew."""


class SampleRing:
    """Samples on their way from one thread to another, without a lock.

    The writer alone moves `_head`, the reader alone `_tail`; both only grow.
    """

    def __init__(self, capacity: int) -> None:
        self._samples = np.zeros(capacity, np.float32)
        self._head = self._tail = 0

    @property
    def waiting(self) -> int:
        """How many samples there are to be read."""
        return self._head - self._tail

    def write(self, samples: NDArray[np.floating[Any]]) -> int:
        """Write samples, as many as there is room for; return how many."""
        count = min(len(samples), len(self._samples) - self.waiting)
        at = np.arange(self._head, self._head + count) % len(self._samples)
        self._samples[at] = samples[:count]
        self._head += count
        return count

    def read(self, out: NDArray[np.float32]) -> int:
        """Fill `out` as far as there are samples; return how far."""
        count = min(len(out), self.waiting)
        at = np.arange(self._tail, self._tail + count) % len(self._samples)
        out[:count] = self._samples[at]
        self._tail += count
        return count

    def skip(self, count: int) -> None:
        """Leave samples out; for the reader."""
        self._tail += min(count, self.waiting)


class Maker:
    """Makes samples of rows, as they come.

    Parameters
    ----------
    tick_rate : float
        Of the loop [Hz].
    """

    def __init__(self, tick_rate: float) -> None:
        from scipy import signal  # slow to import

        self.inner = max((rate for rate in _INNER if rate <= tick_rate), default=_INNER[0])
        self._up = RATE // self.inner
        self._filter = signal.butter(2, LOWEST, "highpass", fs=self.inner, output="sos")
        self._low_pass = self._up * signal.firwin(
            _TAPS * self._up + 1, 0.5 * self.inner, fs=RATE, window=("kaiser", 5.0)
        )
        self._signal = signal
        self.restart()

    def restart(self) -> None:
        """Begin anew: what comes next has nothing to do with what was."""
        self._time = np.empty(0)
        self._place = np.empty((0, 3))
        self._next = math.nan
        self._state = np.zeros((self._filter.shape[0], 2))
        self._tail = np.zeros(_TAPS)

    def samples(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the acceleration [m/s^2] that rows (n, 30) add, at 48 kHz."""
        time, place = rows[:, 0], rows[:, _POSITION]
        known = self._time[-1] if len(self._time) else None
        if known is not None and not known < time[0] < known + _RESTART:
            self.restart()
        self._time = np.concatenate([self._time, time])
        self._place = np.concatenate([self._place, place])
        if math.isnan(self._next):
            self._next = float(self._time[0])
        step = 1.0 / self.inner
        count = int((self._time[-1] - self._next) / step)
        if count < 3:
            return np.empty(0)
        # Two points of the next stretch are those of the last of this one.
        at = self._next + step * np.arange(count + 1)
        even = np.column_stack([np.interp(at, self._time, axis) for axis in self._place.T])
        wave = np.diff(even, 2, axis=0).sum(axis=1) / (math.sqrt(3.0) * step * step)
        self._next = float(at[-2])
        old = int(np.searchsorted(self._time, self._next, side="right")) - 1
        self._time, self._place = self._time[max(old, 0) :], self._place[max(old, 0) :]
        wave, self._state = self._signal.sosfilt(self._filter, wave, zi=self._state)
        whole = np.concatenate([self._tail, wave])
        self._tail = whole[-_TAPS:]
        out = self._signal.upfirdn(self._low_pass, whole, self._up)
        first = _TAPS * self._up
        return np.asarray(out[first : first + len(wave) * self._up])


class LiveSound:
    """Live sound of a link, until it is closed.

    Parameters
    ----------
    link : Link
    full_scale : float
        Acceleration that is full scale [m/s^2]. What comes near is rounded off (tanh): never is
        anything louder.
    open_stream : callable, optional
        Makes the stream of the sound card: called with `samplerate`, `channels`, `dtype`,
        `callback`; has `start`, `stop`, `close`. Default: that of `sounddevice`.

    Raises
    ------
    AsperityError
        There is no `sounddevice`, or no sound device, or it refuses.
    """

    def __init__(
        self,
        link: ServoClient,
        *,
        full_scale: float = 50.0,
        open_stream: Callable[..., Any] | None = None,
    ) -> None:
        self.full_scale = full_scale
        self.rate = RATE
        self.limited = 0.0
        """Which part of the last second was above half of full scale."""
        self._playing = False
        self._ring = SampleRing(RATE)
        self._maker = Maker(link.choice.rate)
        self._stream = _stream(open_stream, self._fill)
        self._stream.start()
        self._untap = link.tap(self._take)

    @staticmethod
    def missing() -> str:
        """Return what live sound lacks on this computer, or nothing."""
        try:
            import sounddevice
        except (ImportError, OSError):
            return "Live sound needs sounddevice and PortAudio: pip install 'asperity[audio]'"
        try:
            sounddevice.query_devices(kind="output")
        except Exception as error:  # PortAudio has errors of its own
            return f"Live sound: no sound device ({' '.join(str(error).split())})"
        return ""

    @property
    def delay(self) -> float:
        """How far the sound is behind the rows [s]."""
        return self._ring.waiting / RATE + 0.5 * _TAPS / self._maker.inner

    def close(self) -> None:
        """End the sound."""
        self._untap()
        self._stream.stop()
        self._stream.close()

    def _take(self, rows: NDArray[np.float64]) -> None:
        """Make samples of new rows; called by who fetches them, so nothing may come out of it."""
        if len(rows):
            self._ring.write(self._maker.samples(rows))

    def _fill(self, out: NDArray[np.float32], frames: int, *_: object) -> None:
        """Fill what the sound card asks for; silence, as long as there is too little."""
        ring = self._ring
        if not self._playing and ring.waiting >= DELAY * RATE:
            self._playing = True
        if ring.waiting > MOST * RATE:
            ring.skip(ring.waiting - int(DELAY * RATE))
        out[:] = 0.0
        if self._playing:
            one = out[:, 0]
            got = ring.read(one)
            level = one[:got] / np.float32(max(self.full_scale, 1e-6))
            share = float(np.mean(np.abs(level) > 0.5)) if got else 0.0
            weight = min(frames / RATE, 1.0)
            self.limited = (1.0 - weight) * self.limited + weight * share
            np.tanh(level, out=one[:got])
            self._playing = got == frames
            out[:, 1:] = one[:, None]


def _stream(make: Callable[..., Any] | None, fill: Callable[..., None]) -> Any:
    """Open a stream; what sound cards say becomes one line."""
    if make is None:
        missing = LiveSound.missing()
        if missing:
            raise AsperityError(missing)
        import sounddevice

        make = sounddevice.OutputStream
    try:
        return make(samplerate=RATE, channels=2, dtype="float32", callback=fill)
    except Exception as error:
        raise AsperityError(f"the sound device refuses: {' '.join(str(error).split())}") from None
