"""The tool's acceleration as live sound from the computer's own sound card.

    ticks of the loop --> acceleration at even steps --> high-pass --> 48 kHz --> ring
    ring --> level --> sound card, which requests samples from its own thread

The thread that fetches ticks for the page makes the samples, and the sound card's thread takes
them; the two share a ring without a lock, one writing and one reading. The loop is not involved.
The sound is the sum of the three axes divided by the root of three, the only combination of three
axes that needs no look-ahead; accelerations that are equal and opposite on two axes cancel.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.realtime.servo.ipc import Ticks

if TYPE_CHECKING:
    from asperity.viewer.servo_client import ServoClient

RATE = 48_000
"""Sampling rate [Hz]."""
LOWEST = 20.0
"""Corner of the high-pass [Hz]: slower motion is the stroke, not the texture, and is inaudible."""
DELAY = 0.07
"""Samples kept in reserve [s]: ticks arrive 60 times a second, in batches."""
MAX_DELAY = 0.20
"""Largest delay [s]; beyond it samples are skipped."""
_INNER = (500, 1000, 2000, 3000, 4000, 6000, 8000, 12_000, 24_000)
"""Rates of the even steps [Hz], of which 48 kHz is a multiple."""
_TAPS = 16
"""Length of the low-pass in steps."""
_RESTART = 0.1
"""Gap between ticks after which the motion is treated as a new one [s]."""


class SampleRing:
    """A ring buffer of samples between two threads, without a lock.

    Only the writer moves `_head`, and only the reader `_tail`; both only grow.
    """

    def __init__(self, capacity: int) -> None:
        self._samples = np.zeros(capacity, np.float32)
        self._head = self._tail = 0

    @property
    def waiting(self) -> int:
        """Number of samples to be read."""
        return self._head - self._tail

    def write(self, samples: NDArray[np.floating[Any]]) -> int:
        """Write samples, as many as there is room for; return how many."""
        count = min(len(samples), len(self._samples) - self.waiting)
        at = np.arange(self._head, self._head + count) % len(self._samples)
        self._samples[at] = samples[:count]
        self._head += count
        return count

    def read(self, out: NDArray[np.float32]) -> int:
        """Fill `out` with as many samples as there are; return how many."""
        count = min(len(out), self.waiting)
        at = np.arange(self._tail, self._tail + count) % len(self._samples)
        out[:count] = self._samples[at]
        self._tail += count
        return count

    def skip(self, count: int) -> None:
        """Drop samples; for the reader."""
        self._tail += min(count, self.waiting)


class AccelerationSound:
    """Converts ticks, as they arrive, to samples of the acceleration.

    Parameters
    ----------
    tick_rate : float
        Rate of the loop [Hz].
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
        """Forget the previous motion."""
        self._time = np.empty(0)
        self._position = np.empty((0, 3))
        self._next = math.nan
        self._state = np.zeros((self._filter.shape[0], 2))
        self._tail = np.zeros(_TAPS)

    def samples(self, ticks: Ticks) -> NDArray[np.float64]:
        """Return the acceleration at 48 kHz that ticks (n,) add [m/s^2]."""
        time, position = ticks["time"], ticks["tool_pose"][:, :3]
        known = self._time[-1] if len(self._time) else None
        if known is not None and not known < time[0] < known + _RESTART:
            self.restart()
        self._time = np.concatenate([self._time, time])
        self._position = np.concatenate([self._position, position])
        if math.isnan(self._next):
            self._next = float(self._time[0])
        step = 1.0 / self.inner
        count = int((self._time[-1] - self._next) / step)
        if count < 3:
            return np.empty(0)
        # The next stretch repeats the last two points of this one.
        at = self._next + step * np.arange(count + 1)
        even = np.column_stack([np.interp(at, self._time, axis) for axis in self._position.T])
        wave = np.diff(even, 2, axis=0).sum(axis=1) / (math.sqrt(3.0) * step * step)
        self._next = float(at[-2])
        old = int(np.searchsorted(self._time, self._next, side="right")) - 1
        self._time, self._position = self._time[max(old, 0) :], self._position[max(old, 0) :]
        wave, self._state = self._signal.sosfilt(self._filter, wave, zi=self._state)
        whole = np.concatenate([self._tail, wave])
        self._tail = whole[-_TAPS:]
        out = self._signal.upfirdn(self._low_pass, whole, self._up)
        first = _TAPS * self._up
        return np.asarray(out[first : first + len(wave) * self._up])


class LiveSound:
    """Live sound of a servo client, until it is closed.

    Parameters
    ----------
    servo : ServoClient
    full_scale : float
        Acceleration at full scale [m/s^2]. Louder samples are limited smoothly (tanh).
    open_stream : callable, optional
        Opens the sound card's stream: called with `samplerate`, `channels`, `dtype` and `callback`;
        returns an object with `start`, `stop` and `close`. Default: `sounddevice.OutputStream`.

    Raises
    ------
    AsperityError
        `sounddevice` or a sound card is missing, or the stream cannot be opened.
    """

    def __init__(
        self,
        servo: ServoClient,
        *,
        full_scale: float = 50.0,
        open_stream: Callable[..., Any] | None = None,
    ) -> None:
        self.full_scale = full_scale
        self.rate = RATE
        self.limited = 0.0
        """Share of the last second that was above half of full scale."""
        self._playing = False
        self._ring = SampleRing(RATE)
        self._maker = AccelerationSound(servo.config.rate)
        self._stream = _stream(open_stream, self._fill)
        self._stream.start()
        self._unsubscribe = servo.subscribe(self._take)

    @staticmethod
    def missing() -> str:
        """Return what this computer lacks for live sound, or ""."""
        try:
            import sounddevice
        except (ImportError, OSError):
            return "Live sound needs sounddevice and PortAudio: pip install 'asperity[audio]'"
        try:
            sounddevice.query_devices(kind="output")
        except Exception as error:  # PortAudio raises its own kinds
            return f"Live sound: no sound device ({' '.join(str(error).split())})"
        return ""

    @property
    def delay(self) -> float:
        """Delay of the sound behind the ticks [s]."""
        return self._ring.waiting / RATE + 0.5 * _TAPS / self._maker.inner

    def close(self) -> None:
        """End the sound."""
        self._unsubscribe()
        self._stream.stop()
        self._stream.close()

    def _take(self, ticks: Ticks) -> None:
        """Add samples for new ticks; called by the thread that fetches them; must not raise."""
        if len(ticks):
            self._ring.write(self._maker.samples(ticks))

    def _fill(self, out: NDArray[np.float32], frames: int, *_: object) -> None:
        """Fill the sound card's buffer; with silence as long as there are too few samples."""
        ring = self._ring
        if not self._playing and ring.waiting >= DELAY * RATE:
            self._playing = True
        if ring.waiting > MAX_DELAY * RATE:
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
    """Open a stream; turn the sound card's errors into one line."""
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
