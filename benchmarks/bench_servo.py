"""The servo loop with recorder, beside an empty loop; and what SIGKILL leaves.

    make bench
    python benchmarks/bench_servo.py [--seconds 60] [--scenes NAME ...] [--kills 100] [--json FILE]

A machine that is not a real-time one wakes even a loop that does nothing late now and then. So for
each scene the servo, in its process with its recorder, and an empty loop, in a process of its own
that sleeps between ticks and has sharpened timers, take turns in blocks of 5 s (a fifteenth of
longer times; `--block`, and `--empty` for a shorter turn of the empty loop); a simulated hand moves
the tool. The report says how the servo passes the time between ticks: where contacts
are quick it keeps a core busy, which is one of the ways in which it may do better than the empty
loop.
It gives the ticks that were finished late or left out (misses), those whose contact was an older
one (fallbacks), their sum beside that of the empty loop, those whose search had to end before its
depth was certified (cut short: it is this tick's contact, but there may be a deeper place), the
tail of how long a tick took and how late it began, and how much the servo's resident memory grew
from a quarter of a block to its end.

The bars: misses and fallbacks at most 0.1 percentage points above the misses of the empty loop;
memory that grows by less than 4 MB; every recording of the killed opens, and lacks a second at
most. They are meant for a machine that does nothing else; it exits with 1 if one is missed.

`make bench` runs ten minutes of each scene, `make bench SERVO_SECONDS=3600` an hour. The kills: a
servo, its recorder, or both at once are killed at a random moment, in turn, and the recording is
opened.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import json
import multiprocessing
import random
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError
from asperity.realtime.servo.deadlines import Pace, SystemClock
from asperity.realtime.servo.process import ServoSpec, simulated_device
from asperity.realtime.servo.running import Servo
from asperity.realtime.servo.scheduling import RealTime, sharpen_timers
from asperity.realtime.servo.stats import Stats
from asperity.runs.recording import read_recording
from asperity.scene.builtin import load_scene
from asperity.scene.trajectory import ScriptedMotion

SCENES = ("probe-plate", "hammer-blocks", "file-cad")
BLOCK = 5.0
DT = 1e-3
BAR = 0.1
"""Percentage points."""
GROWS, LOST = 4.0, 1.0
"""Most that memory may grow by [MB], and that a killed recording may lack [s]."""


def empty_loop(seconds: float, dt: float, report: Any) -> None:
    """Tick and do nothing; send what there is to say of it."""
    sharpen_timers()
    clock = SystemClock()
    pace, stats = Pace(dt, clock), Stats()
    while stats.ticks + stats.skipped < seconds / dt:
        pace.wait()
        missed = clock.now() > pace.deadline
        stats.finished(skipped=pace.skipped, late=pace.late, missed=missed, fallback=False)
    report.send(stats.summary())


def beside_nothing(seconds: float, dt: float) -> dict[str, Any]:
    """Return what there is to say of an empty loop in a process of its own."""
    spawn = multiprocessing.get_context("spawn")
    ours, theirs = spawn.Pipe(duplex=False)
    process = spawn.Process(target=empty_loop, args=(seconds, dt, theirs))
    process.start()
    report: dict[str, Any] = ours.recv()
    process.join()
    return report


def resident(pid: int) -> float:
    """Return the resident memory of a process [MB]."""
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith("VmRSS"):
                return int(line.split()[1]) / 1024
    return 0.0


def spec_of(
    name: str, mode: str, anti_alias: str | None, real_time: RealTime, seconds: float = BLOCK,
    dt: float = DT,
) -> ServoSpec:  # fmt: skip
    scene = load_scene(name).changed(coupling={"mode": mode})
    if anti_alias is not None:
        scene = scene.changed(force={"anti_alias": anti_alias})
    motion = scene.motion
    if isinstance(motion, ScriptedMotion):
        scene = scene.changed(trajectory={"seconds": seconds + 2.0})
        motion = scene.motion
    make = functools.partial(simulated_device, scene, motion, dt)
    return ServoSpec(scene, make, in_scene=True, real_time=real_time, rate=1.0 / dt)


def measured(
    spec: ServoSpec, seconds: float, folder: Path, block: float, empty: float
) -> dict[str, Any]:
    """Let sessions of a servo and of an empty loop take turns; return the sums of both."""
    counted = ("misses", "fallbacks", "cut_short")
    sums = dict.fromkeys(("due", *counted, "empty_due", "empty_misses"), 0)
    worst: dict[str, float] = {}
    grown, done, kept = 0.0, 0.0, {}
    while done < seconds:
        length = min(block, seconds - done)
        done += length
        nothing = beside_nothing(empty * length, 1.0 / spec.rate)
        sums["empty_due"] += nothing["ticks_due"]
        sums["empty_misses"] += nothing["misses"]
        _most(worst, "empty_late", nothing["start_late_us"])
        path = folder / f"{done:.0f}.h5"
        with Servo(spec, path, {"scene": spec.scene.name}) as servo:
            servo.start()
            time.sleep(0.25 * length)
            before = resident(servo.process.pid or 0)
            servo.wait(0.75 * length)
            grown = max(grown, resident(servo.process.pid or 0) - before)
            kept = servo.finish()
        timing = kept["timing"]
        sums["due"] += timing["ticks_due"]
        for what in counted:
            sums[what] += timing[what]
        _most(worst, "tick", timing["stages_us"]["tick"])
        _most(worst, "late", timing["start_late_us"])
        _most(worst, "contact", timing["contact_us"])
        assert kept["recorder"]["ticks_lost"] == 0
        assert len(read_recording(path).time) == timing["ticks"]
        path.unlink()
    return {**sums, "worst_us": worst, "memory_grown_mb": grown, "real_time": kept["real_time"]}


def block_of(seconds: float) -> float:
    return max(BLOCK, seconds / 15.0)


def _most(worst: dict[str, float], name: str, figures: dict[str, float]) -> None:
    for key in ("p50", "p999", "max"):
        worst[f"{name}_{key}"] = max(worst.get(f"{name}_{key}", 0.0), figures[key])


def kills(count: int, folder: Path) -> dict[str, int]:
    """Kill servo, recorder or both at random moments; return how many opened, what they lack."""
    draw = random.Random(7)
    spec = spec_of("probe-plate", "implicit", None, RealTime())
    opened, oldest = 0, 0.0
    for n in range(count):
        path = folder / f"kill-{n}.h5"
        with contextlib.suppress(AsperityError), Servo(spec, path) as servo:
            servo.start()
            time.sleep(draw.uniform(0.0, 2.0))
            moment = servo.snapshot()
            killed = ((servo.process,), (servo.recorder,), (servo.process, servo.recorder))[n % 3]
            for who in killed:
                who.kill()
            for who in killed:
                who.join()
            servo.finish()
        try:
            recording = read_recording(path)
        except AsperityError as error:
            print(f"  kill {n}: {error}")
            continue
        opened += 1
        if moment is not None:
            last = float(recording.time[-1]) if len(recording.time) else 0.0
            oldest = max(oldest, moment.time - last)
        path.unlink()
    return {"kills": count, "opened": opened, "most_lost_s": oldest}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="of servo, for each scene")
    parser.add_argument("--scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--block", type=float, help="seconds of servo in one turn")
    parser.add_argument("--empty", type=float, default=1.0, help="turn of the empty loop, in such")
    parser.add_argument("--rate", type=float, default=1.0 / DT, help="[Hz]")
    parser.add_argument("--mode", default="implicit", help="of the coupling")
    parser.add_argument("--anti-alias", help="off, tick or band; default: as the scene says")
    parser.add_argument("--priority", action="store_true", help="ask for real-time priority")
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    results: dict[str, Any] = {}
    missed = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for scene in given.scenes:
            real_time = RealTime(priority=given.priority)
            block = given.block or block_of(given.seconds)
            spec = spec_of(scene, given.mode, given.anti_alias, real_time, block, 1.0 / given.rate)
            got = results[scene] = measured(spec, given.seconds, folder, block, given.empty)
            missed += [f"{scene}: {what}" for what in missed_bars(scene, got)]
        if given.kills:
            got = results["kills"] = kills(given.kills, folder)
            print(
                f"kills: {got['opened']} of {got['kills']} recordings open; "
                f"at most {got['most_lost_s']:.2f} s lost (bars: all, and {LOST:g} s)"
            )
            if got["opened"] < got["kills"] or got["most_lost_s"] > LOST:
                missed.append("recordings of the killed")
    if given.json:
        given.json.write_text(json.dumps(results, indent=2))
    if missed:
        print(f"missed: {'; '.join(missed)}")
    sys.exit(1 if missed else 0)


def missed_bars(scene: str, got: dict[str, Any]) -> list[str]:
    """Print what came of a scene; return the bars that it missed."""
    misses = 100.0 * got["misses"] / got["due"]
    fallbacks = 100.0 * got["fallbacks"] / got["due"]
    nothing = 100.0 * got["empty_misses"] / got["empty_due"]
    added = misses + fallbacks - nothing
    worst = got["worst_us"]
    print(
        f"{scene}: {got['due']} ticks; misses {misses:.2f} % + fallbacks {fallbacks:.2f} %, empty "
        f"loop {nothing:.2f} %: {added:+.2f} points "
        f"(bar {BAR}: {'met' if added <= BAR else 'MISSED'})"
    )
    print(
        f"  tick median {worst['tick_p50']:.0f}, p99.9 {worst['tick_p999']:.0f}, worst "
        f"{worst['tick_max']:.0f} us; begun late p99.9 {worst['late_p999']:.0f}, worst "
        f"{worst['late_max']:.0f} us (empty {worst['empty_late_p999']:.0f}, "
        f"{worst['empty_late_max']:.0f}); contact median {worst['contact_p50']:.0f}, p99.9 "
        f"{worst['contact_p999']:.0f} us, of {100.0 * got['cut_short'] / got['due']:.2f} % the "
        f"search was cut short; memory {got['memory_grown_mb']:+.1f} MB; between ticks "
        f"{got['real_time']['between_ticks']}"
    )
    bars = {"misses and fallbacks": added > BAR, "memory": got["memory_grown_mb"] > GROWS}
    return [what for what, is_missed in bars.items() if is_missed]


if __name__ == "__main__":
    main()
