"""The Haply client against the fake service: round trip, and whether 1 kHz is kept.

    python benchmarks/bench_devices.py [seconds]

The fake runs in a process of its own, as the real service does. Three kinds of loop take turns of
half a second at 1 kHz, absolute deadlines, so that whatever the machine does meanwhile hits all
alike: an empty one; asperity's client, which exchanges in a thread; and one that sends and receives
in the loop itself. A miss is a tick that ends after its deadline.

The bar: asperity's client adds at most 0.1 percentage points of misses to the empty loop's, and in
99 % of its ticks there is a new pose; it exits with 1 if one is missed.

No device is involved, so a real one adds its own time, and a real service its own.
"""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable

import numpy as np
from websockets.sync.client import connect

from asperity.realtime.devices.haply.fake_device import HaplyFakeDevice
from asperity.realtime.devices.haply.messages import force_message, read_state
from asperity.realtime.devices.protocol import Reading

TICK = 1e-3
TURN = 0.5
MOST_ADDED, LEAST_NEW = 0.1, 99.0
"""Percentage points of misses, and percent of ticks with a new pose."""


class PolledClient:
    """The other way to do it: without a thread, on a socket that never waits."""

    def __init__(self, uri: str) -> None:
        self._link = connect(uri, compression=None, ping_interval=None, proxy=None)
        self._id = read_state(self._link.recv(10.0), None, "auto").device_id

    def read(self, out: Reading) -> bool:
        try:
            state = read_state(self._link.recv(0.0), None, "auto")
        except TimeoutError:
            return False
        out.pose[:3], out.twist[:3] = state.position, state.velocity
        out.pose[3:] = state.orientation
        return True

    def write(self, wrench: np.ndarray) -> None:
        self._link.send(force_message(self._id, tuple(wrench[:3].tolist())), text=True)

    def close(self) -> None:
        self._link.close()


def turn(tick: Callable[[], bool], late: list[float], work: list[float]) -> int:
    """Run a loop at 1 kHz for a turn; return how many ticks saw a new pose."""
    new = 0
    start = time.perf_counter()
    for i in range(round(TURN / TICK)):
        due = start + i * TICK
        wait = due - time.perf_counter()
        if wait > 0.0:
            time.sleep(wait)
        begun = time.perf_counter()
        new += tick()
        ended = time.perf_counter()
        work.append(ended - begun)
        late.append(ended - due - TICK)
    return new


def round_trips(client: HaplyFakeDevice | PolledClient, count: int) -> list[float]:
    """Return the times from a write to the reading that answers it [s]."""
    reading, wrench, times = Reading.empty(), np.zeros(6), []
    time.sleep(0.1)
    client.read(reading)
    for _ in range(count):
        begun = time.perf_counter()
        client.write(wrench)
        while not client.read(reading):
            time.sleep(2e-5)  # lets the thread run
            if time.perf_counter() - begun > 1.0:
                sys.exit("the fake service does not answer")
        times.append(time.perf_counter() - begun)
    return times


def figures(times: list[float]) -> str:
    """Return median, p99, p99.9 and the largest, in microseconds."""
    us = np.array(times) * 1e6
    return "  ".join(f"{np.quantile(us, q):8.0f}" for q in (0.5, 0.99, 0.999, 1.0))


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 30.0
    fake = HaplyFakeDevice()
    fake.open()
    other = PolledClient(fake._uri)
    reading, wrench = Reading.empty(), np.array([0.1, 0.0, 0.3, 0.0, 0.0, 0.0])

    def ticking(client: HaplyFakeDevice | PolledClient) -> Callable[[], bool]:
        def tick() -> bool:
            new = client.read(reading)
            client.write(wrench)
            return new

        return tick

    loops = {"empty": lambda: False, "asperity": ticking(fake), "polled": ticking(other)}
    late: dict[str, list[float]] = {name: [] for name in loops}
    work: dict[str, list[float]] = {name: [] for name in loops}
    new = dict.fromkeys(loops, 0)
    round_trips(fake, 200)
    gc.collect()
    gc.freeze()
    gc.disable()
    for _ in range(max(1, round(seconds / TURN / len(loops)))):
        for name, tick in loops.items():
            new[name] += turn(tick, late[name], work[name])
    trips = {"asperity": round_trips(fake, 5000), "polled": round_trips(other, 5000)}
    gc.enable()
    fake.close()
    other.close()

    print(f"{'us':26}{'median':>8}  {'p99':>8}  {'p99.9':>8}  {'max':>8}")
    for name, times in trips.items():
        print(f"{'round trip, ' + name:26}{figures(times)}")
    for name in loops:
        print(f"{'read and write, ' + name:26}{figures(work[name])}")
    for name in loops:
        print(f"{'end after due, ' + name:26}{figures([x + TICK for x in late[name]])}")
    shares = {}
    for name in loops:
        ticks = len(late[name])
        misses = sum(x > 0.0 for x in late[name])
        shares[name] = 100.0 * misses / ticks
        share = f"{100.0 * new[name] / ticks:.2f} % of ticks with a new pose" if new[name] else ""
        print(f"{name}: {misses} of {ticks} ticks missed ({shares[name]:.2f} %); {share}")
    for name in ("asperity", "polled"):
        added = shares[name] - shares["empty"]
        print(f"{name} adds {added:+.2f} percentage points of misses to the empty loop's")
    added = shares["asperity"] - shares["empty"]
    news = 100.0 * new["asperity"] / len(late["asperity"])
    held = added <= MOST_ADDED and news >= LEAST_NEW
    print(f"1 kHz is {'sustained' if held else 'NOT sustained'}")
    sys.exit(0 if held else 1)


if __name__ == "__main__":
    main()
